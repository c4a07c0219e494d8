"""Opens a bundle of unknown origin: unpacks it safely and compares every file with the manifest."""

import hashlib
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from vsnbench.errors import RecordError
from vsnbench.evidence.bundle.stored_zip import StoredZipEntry, StoredZipReader, first_file
from vsnbench.text.sanitize import sanitize

FORMAT_VERSION = 1
FORMAT_FILE = "vsnbench-bundle.txt"
"""First file of an archive; its only line has the version of the format."""
MANIFEST = "manifest-sha256.txt"
"""SHA-256 of every file except itself and the signatures, as `sha256sum --check` reads it."""
SIGNATURES = "signatures"
RESULTS = "results"

_FORMAT_LINE = re.compile(rb"vsnbench bundle format (\d{1,9})\n")
_MANIFEST_LINE = re.compile(r"([0-9a-f]{64})  (.+)")
_NAME = re.compile(r"(?:[A-Za-z0-9_][A-Za-z0-9._-]*/)*[A-Za-z0-9_][A-Za-z0-9._-]*", re.ASCII)
"""Relative names without hidden files, blanks, backslashes, drives and `..`."""
_LONGEST_NAME = 240
_MOST_FILES = 5_000_000
_LONGEST_FORMAT_BYTES = 100
_LARGEST_LIST_BYTES = 2**30
_LARGEST_SIGNATURE_BYTES = 2**16


class Mismatch(StrEnum):
    """Kinds of differences between a bundle and its manifest."""

    MISSING = "missing"
    ADDITIONAL = "not in the manifest"
    CHANGED = "changed"
    ARCHIVE = "changed in the archive's own structure"
    """A header of the file, or the archive's directory, is not as vsnbench wrote it; the content may be intact."""


@dataclass(frozen=True, slots=True, order=True)
class BundleProblem:
    """A file that differs from the manifest."""

    path: str
    """Relative to the bundle; empty for the archive's directory."""
    mismatch: Mismatch

    def __str__(self) -> str:
        return f"{self.path or 'the end of the archive'}: {self.mismatch}"


@dataclass(frozen=True, slots=True)
class OpenBundle:
    """A bundle on disk whose files were compared with its manifest."""

    directory: Path
    problems: tuple[BundleProblem, ...]
    """Differences from the manifest; empty if every byte is as it was written."""
    files: Mapping[str, str]
    """Path of each file in the manifest, relative to `directory`, with its SHA-256."""
    signatures: tuple[Path, ...]
    """Files with signatures of the manifest; their validity is unknown (`bundle.signatures`)."""

    @property
    def results(self) -> Path:
        """The results directory in it. Its database is as untrusted as any other."""
        return self.directory / RESULTS

    @property
    def manifest(self) -> Path:
        """The list of hashes, which signatures are made of."""
        return self.directory / MANIFEST


def format_line() -> bytes:
    """Return the content of FORMAT_FILE."""
    return f"vsnbench bundle format {FORMAT_VERSION}\n".encode()


def manifest_lines(files: Iterable[tuple[str, str]]) -> str:
    """Return the manifest of files with their SHA-256, in this order."""
    return "".join(f"{sha256}  {name}\n" for name, sha256 in files)


def open_bundle(path: Path, into: Path) -> OpenBundle:
    """Open a bundle, and compare every file with the manifest.

    Args:
        path: the archive, or a directory with its unpacked content, which stays unchanged.
        into: directory for the content of an archive; new or empty. Nothing is written elsewhere.

    Raises:
        RecordError: not a bundle, one of a newer version, or an archive that is truncated, damaged or made to harm.
    """
    try:
        if path.is_dir():
            return _compared(path, dict(_hashes_below(path)), [])
        return _unpacked(path, into)
    except OSError as error:
        raise RecordError(f"cannot open the bundle {path}: {error.strerror or error}") from error


def _unpacked(path: Path, into: Path) -> OpenBundle:
    if not path.is_file():
        raise RecordError(f"no bundle at {path}", advice="name an archive, or a directory with its content")
    size = path.stat().st_size
    into.mkdir(parents=True, exist_ok=True)
    if any(into.iterdir()):
        raise RecordError(f"{into} is not empty", advice="name a new directory")
    if (free := shutil.disk_usage(into).free) < size:
        raise RecordError(
            f"the disk of {into} has {free / 1e9:.1f} GB left, and the bundle needs {size / 1e9:.1f} GB",
            advice="free some space, or unpack it elsewhere and name its directory",
        )
    with path.open("rb", buffering=0) as file:  # a buffer would be filled again for every header
        first, content = first_file(file, _LONGEST_FORMAT_BYTES)
        if first != FORMAT_FILE:
            raise _not_a_bundle(path)
        _check_version(path, content)
        reader = StoredZipReader(file, size)
        _check_names(reader.names)
        hashes: dict[str, str] = {}
        for entry in reader.files():
            _write(entry, into / entry.name)
            hashes[entry.name] = entry.finish().sha256
    altered = [BundleProblem(name, Mismatch.ARCHIVE) for name in reader.altered]
    altered += [BundleProblem("", Mismatch.ARCHIVE)] if reader.directory_altered else []
    return _compared(into, hashes, altered)


def _check_version(path: Path, content: bytes) -> None:
    """Check the version in the content of FORMAT_FILE; the headers of an archive may follow it."""
    match = _FORMAT_LINE.match(content)
    if match is None:
        raise RecordError(
            f"the first file of {path}, {FORMAT_FILE}, is not as `vsnbench bundle` writes it",
            advice="get another copy of it",
            code="damaged-bundle",
        )
    if (version := int(match[1])) > FORMAT_VERSION:
        raise RecordError(
            f"the bundle {path} has format {version} by its {FORMAT_FILE}, and this version of vsnbench reads up to "
            f"{FORMAT_VERSION}",
            advice="upgrade vsnbench",
            code="newer-bundle",
        )


def _not_a_bundle(path: Path) -> RecordError:
    return RecordError(
        f"{path} is not a bundle as `vsnbench bundle` writes it",
        advice="if another program packed it again, unpack it and name the directory",
        code="not-a-bundle",
    )


def _check_names(names: Sequence[str]) -> None:
    """Check names before files are written under them.

    Raises:
        RecordError: one could lead out of the directory, or two are one file on some disk.
    """
    if len(names) > _MOST_FILES:
        raise _unsafe(f"contains more than {_MOST_FILES:,} files")
    files: set[str] = set()
    known_folders: set[str] = set()
    for name in names:
        folded = name.lower()
        folders = {folded[:place] for place, letter in enumerate(folded) if letter == "/"}
        if len(name) > _LONGEST_NAME or _NAME.fullmatch(name) is None:
            raise _unsafe(f"contains the name {sanitize(name)[:100]!r}, which vsnbench never writes")
        if folded in files or folded in known_folders or not folders.isdisjoint(files):
            raise _unsafe(f"contains {name!r} twice, or two names that are one on some disks")
        files.add(folded)
        known_folders |= folders


def _unsafe(what: str) -> RecordError:
    return RecordError(f"the bundle {what}", advice="it is not used; get it from its author", code="unsafe-bundle")


def _write(entry: StoredZipEntry, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666)
    with open(descriptor, "wb") as file:  # noqa: PTH123 - a descriptor, not a path
        for part in entry.parts():
            file.write(part)


def _hashes_below(directory: Path) -> Iterator[tuple[str, str]]:
    """Yield the files of an unpacked bundle with their SHA-256; links and devices are refused."""
    folders = [directory]
    while folders:
        with os.scandir(folders.pop()) as entries:
            for entry in entries:
                name = Path(entry.path).relative_to(directory).as_posix()
                if entry.is_dir(follow_symlinks=False):
                    folders.append(Path(entry.path))
                elif entry.is_file(follow_symlinks=False):
                    with Path(entry.path).open("rb") as file:
                        yield name, hashlib.file_digest(file, "sha256").hexdigest()
                else:
                    raise _unsafe(f"contains {sanitize(name)[:100]!r}, which is not a regular file")


def _compared(directory: Path, hashes: dict[str, str], problems: list[BundleProblem]) -> OpenBundle:
    if FORMAT_FILE not in hashes:
        raise _not_a_bundle(directory)
    _check_version(directory, _read(directory / FORMAT_FILE, _LONGEST_FORMAT_BYTES))
    content = _read(directory / MANIFEST, _LARGEST_LIST_BYTES)
    listed = {}
    for line in content.decode("utf-8", "replace").splitlines():
        if (match := _MANIFEST_LINE.fullmatch(line)) and _NAME.fullmatch(match[2]):
            listed[match[2]] = match[1]
    if manifest_lines(listed.items()).encode() != content:
        problems.append(BundleProblem(MANIFEST, Mismatch.CHANGED))
    signatures = [
        name
        for name in hashes
        if name.startswith(f"{SIGNATURES}/")
        and name not in listed
        and (directory / name).stat().st_size <= _LARGEST_SIGNATURE_BYTES
    ]
    for name in {*listed, *hashes} - {MANIFEST, *signatures}:
        if name not in hashes:
            problems.append(BundleProblem(name, Mismatch.MISSING))
        elif name not in listed:
            problems.append(BundleProblem(name, Mismatch.ADDITIONAL))
        elif hashes[name] != listed[name]:
            problems.append(BundleProblem(name, Mismatch.CHANGED))
    return OpenBundle(
        directory, tuple(sorted(problems)), listed, tuple(directory / name for name in sorted(signatures))
    )


def _read(file: Path, limit: int) -> bytes:
    if not file.is_file():
        raise RecordError(
            f"the bundle has no {file.name}", advice="it is incomplete: get another copy", code="damaged-bundle"
        )
    if file.stat().st_size > limit:
        raise _unsafe(f"has a {file.name} of more than {limit:,} bytes")
    return file.read_bytes()
