"""ZIP archives without compression, of which every byte follows from the names and contents of their files.

Without compression the bytes do not depend on the version of a library, and an archive cannot expand. `zipfile` checks
few fields of the headers, so the headers of an archive that is read are made again and compared.
"""

import hashlib
import io
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import IO, Any, BinaryIO, Self

from vsnbench.errors import RecordError

_EARLIEST = (1980, 1, 1, 0, 0, 0)
"""The earliest date of the format: the time of bundling is not part of a bundle."""
_UNIX = 3
_MODE = 0o100644 << 16
_MADE_BY = 45
_ENCRYPTED = 1
_LOCAL_HEADER_BYTES = 30
_AT_ONCE_BYTES = 2**20
_ADVICE = "get another copy of it; if another program packed it again, unpack it and name the directory"


@dataclass(frozen=True, slots=True)
class StoredFile:
    """A file in an archive."""

    name: str
    size_bytes: int
    sha256: str


class StoredZipWriter:
    """Writes files to an archive in the order in which they are added; a context manager."""

    def __init__(self, file: BinaryIO) -> None:
        """Begin an archive in an empty file."""
        self._file = file
        self._archive = zipfile.ZipFile(file, "w", zipfile.ZIP_STORED)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._archive.close()  # zipfile would do it later, when the file is closed

    def add(self, name: str, source: BinaryIO, size_bytes: int) -> StoredFile:
        """Copy a file into the archive.

        Raises:
            RecordError: the source has another size.
        """
        digest, copied = hashlib.sha256(), 0
        with self._archive.open(_stored_info(name, size_bytes), "w") as target:
            while part := source.read(_AT_ONCE_BYTES):
                digest.update(part)
                copied += len(part)
                target.write(part)
        if copied != size_bytes:
            raise RecordError(f"{name} changed while it was copied", advice="repeat the command when no run writes")
        return StoredFile(name, size_bytes, digest.hexdigest())

    def close(self) -> int:
        """Write the directory of the archive, and return its size in bytes."""
        self._archive.close()
        return self._file.seek(0, io.SEEK_END)


class StoredZipReader:
    """Reads the files of an archive in order; nothing of it is trusted."""

    def __init__(self, file: BinaryIO, size_bytes: int) -> None:
        """Read the directory of an archive.

        Raises:
            RecordError: the archive is truncated, damaged, compressed or encrypted.
        """
        self._file = file
        self._size_bytes = size_bytes
        self.altered: list[str] = []
        """Names of files whose header differs from what `StoredZipWriter` writes."""
        self.directory_altered = False
        """Whether the directory differs from what `StoredZipWriter` writes; known after the last file."""
        if not zipfile.is_zipfile(file):
            raise _damaged("its end is missing", "truncated-bundle")
        try:
            self._infos = zipfile.ZipFile(file).infolist()
        except (zipfile.BadZipFile, NotImplementedError, ValueError, OSError) as error:
            # zipfile has each of these for a damaged directory: NotImplementedError for a version it does not know.
            raise _damaged(f"its directory is damaged ({error})", "damaged-bundle") from error
        self.names = [info.filename for info in self._infos]
        for info in self._infos:
            if info.flag_bits & _ENCRYPTED:
                raise _damaged(f"its file {info.filename!r} is encrypted", "unsafe-bundle")
            if info.compress_type != zipfile.ZIP_STORED or info.compress_size != info.file_size:
                raise _damaged(f"its file {info.filename!r} is compressed, which vsnbench never does", "unsafe-bundle")
        if sum(info.file_size for info in self._infos) > size_bytes:
            raise _damaged("its files are larger than itself", "truncated-bundle")

    def files(self) -> Iterator["StoredZipEntry"]:
        """Yield the files; the content of each must be read before the next.

        Raises:
            RecordError: the archive ends before a file.
        """
        headers = _Headers(self._file)
        with zipfile.ZipFile(headers, "w", zipfile.ZIP_STORED) as again:
            for info in self._infos:
                with again.open(_stored_info(info.filename, info.file_size), "w") as target:
                    self._file.seek(headers.tell())
                    with headers.without_content():
                        entry = StoredZipEntry(self._file, info.filename, info.file_size, target)
                        yield entry
                        entry.finish()
                if not headers.are_equal():
                    self.altered.append(info.filename)
        self.directory_altered = not headers.are_equal() or headers.tell() != self._size_bytes


class StoredZipEntry:
    """A file of an archive that is read."""

    def __init__(self, file: BinaryIO, name: str, size_bytes: int, copy: IO[bytes]) -> None:
        self._file = file
        self._left = size_bytes
        self._copy = copy
        self._digest = hashlib.sha256()
        self.name = name
        self.size_bytes = size_bytes

    def parts(self) -> Iterator[bytes]:
        """Yield the content that is left.

        Raises:
            RecordError: the archive ends before.
        """
        while self._left:
            part = self._file.read(min(self._left, _AT_ONCE_BYTES))
            if not part:
                raise _damaged(f"it is truncated in {self.name!r}", "truncated-bundle")
            self._left -= len(part)
            self._digest.update(part)
            self._copy.write(part)
            yield part

    def finish(self) -> StoredFile:
        """Read what is left, and return the file's hash."""
        for _ in self.parts():
            pass
        return StoredFile(self.name, self.size_bytes, self._digest.hexdigest())


class _Headers(io.RawIOBase):
    """Takes an archive that is written, and compares all but the contents of its files with another archive."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._position = 0
        self._in_content = False
        self._pieces: dict[int, bytearray] = {}
        """Position -> bytes that were written there since the last comparison."""
        self._newest = 0

    def seekable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._position

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:  # noqa: ARG002 - zipfile seeks from the beginning
        self._position = offset
        return offset

    def write(self, content: Any) -> int:
        if not self._in_content:
            if self._newest in self._pieces and self._newest + len(self._pieces[self._newest]) == self._position:
                self._pieces[self._newest] += content
            else:
                self._newest = self._position
                self._pieces[self._position] = bytearray(content)
        self._position += len(content)
        return len(content)

    @contextmanager
    def without_content(self) -> Iterator[None]:
        """Leave what is written in the block out of the comparison."""
        self._in_content = True
        try:
            yield
        finally:
            self._in_content = False

    def are_equal(self) -> bool:
        """Return whether the other archive has the same bytes as those written since the last call."""
        pieces, self._pieces = self._pieces, {}
        for position, expected in pieces.items():
            self._file.seek(position)
            if self._file.read(len(expected)) != expected:
                return False
        return True


def _stored_info(name: str, size_bytes: int) -> zipfile.ZipInfo:
    """Return the header of a file that is not compressed."""
    info = zipfile.ZipInfo(name, _EARLIEST)
    info.file_size, info.create_system, info.create_version, info.external_attr = size_bytes, _UNIX, _MADE_BY, _MODE
    return info


def first_file(file: BinaryIO, longest_bytes: int) -> tuple[str, bytes]:
    """Return the name of the first file, and the bytes that follow it; both empty if there is none."""
    header = file.read(_LOCAL_HEADER_BYTES)
    if len(header) < _LOCAL_HEADER_BYTES or header[:4] != b"PK\x03\x04":
        return "", b""
    name = file.read(int.from_bytes(header[26:28], "little"))
    return name.decode("ascii", "backslashreplace"), file.read(longest_bytes)


def _damaged(what: str, code: str) -> RecordError:
    return RecordError(f"the archive cannot be opened: {what}", advice=_ADVICE, code=code)
