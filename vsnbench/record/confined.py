"""Paths that a record names: never outside its own directory, whatever its database or a symbolic link in it says.

A results directory may be somebody else's archive, so nothing in it is believed: a path is followed to its end before
it is used, and only an ordinary file of a bounded size is read.
"""

from pathlib import Path

from vsnbench.errors import RecordError

LARGEST_FILE_BYTES = 64 * 2**20
"""The largest image that is read; a 16-bit PNG of 4096 x 4096 pixels has half of it."""


def confined(root: Path, named: str | Path) -> Path:
    """Return a path inside `root`, with every symbolic link followed.

    Args:
        root: a directory of the record; it may itself be reached through a link, as its owner chose.
        named: relative to it, from the record.

    Raises:
        RecordError: it leads elsewhere.
    """
    try:
        top = root.resolve()
        path = (top / named).resolve()
        path.exists()
    except (OSError, ValueError, RuntimeError) as error:  # too long, a NUL in it, a ring of links
        raise RecordError(f"{root} names a path that cannot be used ({error}); nothing was touched") from error
    if not path.is_relative_to(top):
        raise RecordError(
            f"the record in {root} names the path {str(named)[:200]!r}, which leads out of it; nothing was touched: "
            "whoever made this record did not make it with vsnbench"
        )
    return path


def read_confined(root: Path, named: str | Path) -> bytes | None:
    """Return the bytes of a file that the record names; None where there is no ordinary file.

    Raises:
        RecordError: it lies outside `root`, is larger than LARGEST_FILE_BYTES, or cannot be read.
    """
    path = confined(root, named)
    if not path.is_file():  # a directory, a device, a pipe that would block for ever
        return None
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE_BYTES + 1)
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror or error}") from error
    if len(content) > LARGEST_FILE_BYTES:
        raise RecordError(f"{path} is larger than {LARGEST_FILE_BYTES // 2**20} MiB: no image of a record is")
    return content
