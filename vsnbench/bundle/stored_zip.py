"""ZIP archives without compression, of which every byte follows from the names and contents of their files.

Python's `zipfile` keeps every entry in memory and does not check the fields of a header. Without compression the bytes
do not depend on the version of a library, and an archive cannot expand.
"""

import hashlib
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from vsnbench.errors import RecordError

_LOCAL = struct.Struct("<4s5H3L2H")
_CENTRAL = struct.Struct("<4s6H3L5H2L")
_END = struct.Struct("<4s4H2LH")
_END_64 = struct.Struct("<4sQ2H2L4Q")
_LOCATOR_64 = struct.Struct("<4sLQL")
_LOCAL_SIGNATURE, _CENTRAL_SIGNATURE = b"PK\x03\x04", b"PK\x01\x02"
_DATE = 1 << 5 | 1
"""1980-01-01, the earliest date of the format: the time of bundling is not part of a bundle."""
_MADE_BY_UNIX = 3 << 8 | 45
_MODE = 0o100644 << 16
_LIMIT_32 = 0xFFFFFFFF
_LIMIT_16 = 0xFFFF
"""Larger sizes, offsets and numbers of files need the fields of ZIP64."""
_AT_ONCE_BYTES = 2**20
_ADVICE = "get another copy of it; if another program packed it again, unpack it and name the directory"


@dataclass(frozen=True, slots=True)
class StoredFile:
    """A file in an archive."""

    name: str
    size_bytes: int
    crc: int
    sha256: str


class StoredZipWriter:
    """Writes files to an archive in the order in which they are added."""

    def __init__(self, file: BinaryIO) -> None:
        """Begin an archive in an empty file."""
        self._file = file
        self._directory = _Directory()

    def add(self, name: str, source: BinaryIO, size_bytes: int) -> StoredFile:
        """Copy a file into the archive.

        Raises:
            RecordError: the source has another size.
        """
        offset = self._file.tell()
        self._file.write(_local_header(name, size_bytes, 0))
        digest, crc, copied = hashlib.sha256(), 0, 0
        while part := source.read(_AT_ONCE_BYTES):
            digest.update(part)
            crc = zlib.crc32(part, crc)
            copied += len(part)
            self._file.write(part)
        if copied != size_bytes:
            raise RecordError(f"{name} changed while it was copied", advice="repeat the command when no run writes")
        end = self._file.tell()
        self._file.seek(offset)
        self._file.write(_local_header(name, size_bytes, crc))
        self._file.seek(end)
        added = StoredFile(name, size_bytes, crc, digest.hexdigest())
        self._directory.add(added, offset)
        return added

    def close(self) -> int:
        """Write the directory of the archive, and return its size in bytes."""
        entries, end = self._directory.parts(self._file.tell())
        self._file.write(entries)
        self._file.write(end)
        return self._file.tell()


class StoredZipReader:
    """Reads the files of an archive in order; nothing of it is trusted."""

    def __init__(self, file: BinaryIO, size_bytes: int) -> None:
        """Begin to read an archive at its beginning."""
        self._file = file
        self._size_bytes = size_bytes
        self._directory = _Directory()
        self.altered: list[str] = []
        """Names of files whose header differs from what `StoredZipWriter` writes."""
        self.directory_altered = False
        """Whether the directory differs from what `StoredZipWriter` writes; known after the last file."""

    def first_name(self) -> str:
        """Return the name of the first file without reading on; empty if there is none."""
        begin = self._file.tell()
        header = self._file.read(_LOCAL.size)
        name = b""
        if len(header) == _LOCAL.size and header[:4] == _LOCAL_SIGNATURE:
            name = self._file.read(_LOCAL.unpack(header)[9])
        self._file.seek(begin)
        return name.decode("ascii", "backslashreplace")

    def files(self) -> Iterator["StoredZipEntry"]:
        """Yield the files; the content of each must be read before the next.

        Raises:
            RecordError: the archive is truncated, damaged, compressed or encrypted.
        """
        last = "its beginning"
        while True:
            offset = self._file.tell()
            header = self._file.read(_LOCAL.size)
            if header[:4] == _CENTRAL_SIGNATURE:
                break
            if len(header) < _LOCAL.size:
                raise _damaged(f"it is truncated after {last}", "truncated-bundle")
            if header[:4] != _LOCAL_SIGNATURE:
                raise _damaged(f"it is damaged after {last}", "damaged-bundle")
            entry = self._entry(header)
            yield entry
            last = entry.name
            stored = entry.finish()
            if entry.header != _local_header(stored.name, stored.size_bytes, stored.crc):
                self.altered.append(stored.name)
            self._directory.add(stored, offset)
        self._file.seek(offset)
        parts = self._directory.parts(offset)
        self.directory_altered = self._size_bytes != offset + sum(map(len, parts))
        for expected in parts:
            found = self._file.read(len(expected))
            if len(found) < len(expected) and expected.startswith(found):
                raise _damaged(f"it is truncated after {last}", "truncated-bundle")
            self.directory_altered |= found != expected

    def _entry(self, header: bytes) -> "StoredZipEntry":
        _, _, flags, method, _, _, _, size, full_size, name_length, extra_length = _LOCAL.unpack(header)
        rest = self._file.read(name_length + extra_length)
        name = rest[:name_length].decode("ascii", "backslashreplace")
        if flags & 1:
            raise _damaged(f"its file {name!r} is encrypted", "unsafe-bundle")
        if method or flags & 8:
            raise _damaged(f"its file {name!r} is compressed, which vsnbench never does", "unsafe-bundle")
        extra = rest[name_length:]
        if size == _LIMIT_32 and len(extra) == 20:
            _, _, full_size, size = struct.unpack("<2H2Q", extra)
        if size != full_size:
            raise _damaged(f"its file {name!r} has two sizes", "damaged-bundle")
        if len(rest) < name_length + extra_length or self._file.tell() + size > self._size_bytes:
            raise _damaged(f"it is truncated in {name!r}", "truncated-bundle")
        return StoredZipEntry(self._file, name, size, header + rest)


class StoredZipEntry:
    """A file of an archive that is read."""

    def __init__(self, file: BinaryIO, name: str, size_bytes: int, header: bytes) -> None:
        self._file = file
        self._left = size_bytes
        self._digest = hashlib.sha256()
        self._crc = 0
        self.name = name
        self.size_bytes = size_bytes
        self.header = header

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
            self._crc = zlib.crc32(part, self._crc)
            yield part

    def finish(self) -> StoredFile:
        """Read what is left, and return the file's hash."""
        for _ in self.parts():
            pass
        return StoredFile(self.name, self.size_bytes, self._crc, self._digest.hexdigest())


class _Directory:
    """The directory at the end of an archive."""

    def __init__(self) -> None:
        self._entries = bytearray()
        self._count = 0

    def add(self, stored: StoredFile, offset: int) -> None:
        name = stored.name.encode("ascii", "backslashreplace")
        large = struct.pack("<2Q", stored.size_bytes, stored.size_bytes) if stored.size_bytes >= _LIMIT_32 else b""
        large += struct.pack("<Q", offset) if offset >= _LIMIT_32 else b""
        extra = struct.pack("<2H", 1, len(large)) + large if large else b""
        size = min(stored.size_bytes, _LIMIT_32)
        self._entries += _CENTRAL.pack(
            *(_CENTRAL_SIGNATURE, _MADE_BY_UNIX, 45 if large else 20, 0, 0, 0, _DATE, stored.crc, size, size),
            *(len(name), len(extra), 0, 0, 0, _MODE, min(offset, _LIMIT_32)),
        )
        self._entries += name + extra
        self._count += 1

    def parts(self, offset: int) -> tuple[bytearray, bytes]:
        """Return the directory and its end, for an archive in which it begins at `offset`."""
        size, count = len(self._entries), self._count
        end = b""
        if count >= _LIMIT_16 or size >= _LIMIT_32 or offset >= _LIMIT_32:
            end = _END_64.pack(b"PK\x06\x06", 44, _MADE_BY_UNIX, 45, 0, 0, count, count, size, offset)
            end += _LOCATOR_64.pack(b"PK\x06\x07", 0, offset + size, 1)
        few = min(count, _LIMIT_16)
        end += _END.pack(b"PK\x05\x06", 0, 0, few, few, min(size, _LIMIT_32), min(offset, _LIMIT_32), 0)
        return self._entries, end


def _local_header(name: str, size_bytes: int, crc: int) -> bytes:
    encoded = name.encode("ascii", "backslashreplace")
    extra = struct.pack("<2H2Q", 1, 16, size_bytes, size_bytes) if size_bytes >= _LIMIT_32 else b""
    size = min(size_bytes, _LIMIT_32)
    needs = 45 if extra else 20
    fields = (_LOCAL_SIGNATURE, needs, 0, 0, 0, _DATE, crc, size, size, len(encoded), len(extra))
    return _LOCAL.pack(*fields) + encoded + extra


def _damaged(what: str, code: str) -> RecordError:
    return RecordError(f"the archive cannot be opened: {what}", advice=_ADVICE, code=code)
