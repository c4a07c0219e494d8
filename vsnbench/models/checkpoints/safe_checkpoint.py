"""Loads PyTorch checkpoints of unknown origin, without PyTorch: no code from the file runs.

The archive is a zip file of plain records. Its declared sizes and its checksums are checked first, so that memory is
bounded by the file's size.
"""

import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy.typing as npt

from vsnbench.errors import ModelError
from vsnbench.files.regular import open_regular
from vsnbench.models.checkpoints.pickle_reader import DeclaredStorage, numbers_of, read_pickle

_LARGEST_PICKLE_BYTES = 2 * 2**20
"""The released checkpoints need about 60 kB; a pickle can grow in memory to some hundred times its size."""
_LEGACY_MAGIC = b"\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19"
_SAVE_AGAIN = "old formats can run code when they are read; save it again with torch.save of PyTorch 1.6 or later"


def load_checkpoint(path: Path, allowed_classes: frozenset[str] = frozenset()) -> Any:
    """Return the content of a PyTorch checkpoint: plain values, dictionaries and arrays, which cannot be written to.

    Args:
        path: a file written by `torch.save` (PyTorch 1.6 or later).
        allowed_classes: full names of dictionary classes (`package.module.Class`) that the file may contain; they are
            returned as `dict`, neither imported nor run.

    Raises:
        ModelError: the file cannot be read, is not such a checkpoint, is damaged, or would run code.
    """
    origin = str(path)
    try:
        with open_regular(path) as file:
            head = file.read(512)
        if not head.startswith(b"PK") or not _is_archive(path):
            raise ModelError(f"{origin}: {_describe_file(head)}")
        with zipfile.ZipFile(path) as archive:
            return _load(archive, path.stat().st_size, allowed_classes, origin)
    except OSError as error:
        raise ModelError(f"cannot read weights {origin}: {error.strerror or error}") from error
    except (zipfile.BadZipFile, struct.error, EOFError, NotImplementedError, RuntimeError, ValueError) as error:
        # zipfile raises all of these for damaged archives: NotImplementedError for an unknown compression, RuntimeError
        # for an encrypted entry, ValueError for a directory that points outside the file, struct.error and EOFError for
        # a truncated header or entry.
        raise ModelError(f"{origin}: truncated or damaged ({error})", advice="download it again") from error


def _is_archive(path: Path) -> bool:
    """Whether a file ends as a zip archive; reading it reports an end that is damaged."""
    try:
        return zipfile.is_zipfile(path)
    except zipfile.BadZipFile:
        return True


def _load(archive: zipfile.ZipFile, file_bytes: int, allowed_classes: frozenset[str], origin: str) -> Any:
    """Check the archive's directory and checksums, then read its pickle and the records that it refers to."""
    entries = {entry.filename: entry for entry in archive.infolist()}
    roots = {name.partition("/")[0] for name in entries}
    if len(entries) != len(archive.infolist()) or len(roots) != 1:
        raise ModelError(f"{origin}: a zip archive, but not one that PyTorch wrote")
    root = roots.pop()
    if f"{root}/constants.pkl" in entries or any(name.startswith(f"{root}/code/") for name in entries):
        raise ModelError(f"{origin}: a TorchScript program, not a checkpoint; nothing was run")
    pickled = entries.get(f"{root}/data.pkl")
    if pickled is None:
        raise ModelError(f"{origin}: a zip archive, but not one that PyTorch wrote")
    if any(entry.compress_type != zipfile.ZIP_STORED for entry in entries.values()):
        raise ModelError(f"{origin}: its records are compressed, which PyTorch never does; refused")
    # zipfile allocates the larger of the two sizes at once.
    if sum(max(entry.file_size, entry.compress_size) for entry in entries.values()) > file_bytes:
        raise ModelError(f"{origin}: its records claim more bytes than the file has; refused")
    if pickled.file_size > _LARGEST_PICKLE_BYTES:
        raise ModelError(f"{origin}: {pickled.file_size} bytes of structure in addition to the weights; refused")
    if (broken := archive.testzip()) is not None:
        raise ModelError(f"{origin}: the record {broken[:80]} differs from its checksum; damaged, download it again")
    byte_order = entries.get(f"{root}/byteorder")
    big_endian = byte_order is not None and archive.read(byte_order) == b"big"

    def stored(storage: DeclaredStorage) -> npt.NDArray[Any]:
        record = entries.get(f"{root}/data/{storage.key}")
        if record is None or record.file_size != storage.size_bytes:
            actual = "no such record" if record is None else f"{record.file_size} bytes"
            raise ModelError(
                f"{origin}: storage {storage.key[:20]} should have {storage.size_bytes} bytes, the file has "
                f"{actual}; damaged or forged, nothing was loaded"
            )
        return numbers_of(storage, archive.read(record), big_endian=big_endian)

    return read_pickle(archive.read(pickled), allowed_classes, origin, stored)


def _describe_file(head: bytes) -> str:
    """Return what kind of file it is if it is not a complete zip archive."""
    if not head:
        return "empty; download it again"
    if head.startswith(b"PK"):
        return "truncated: the archive has no end; download it again"
    if head.lstrip()[:1] == b"<":
        return "a web page, not weights: the download link may want a log-in"
    if head.startswith(b"version https://git-lfs"):
        return "a Git LFS pointer, not the weights themselves; run `git lfs pull` in its repository"
    if _LEGACY_MAGIC in head[:16]:
        return f"a checkpoint in PyTorch's legacy format; {_SAVE_AGAIN}"
    if head[257:262] == b"ustar":
        return f"a tar archive, PyTorch's oldest format; {_SAVE_AGAIN}"
    if head.startswith(b"\x80") or head[:1] in b"c(]}":
        return f"a bare pickle, not a PyTorch checkpoint; {_SAVE_AGAIN}"
    return "not a PyTorch checkpoint"
