"""Confines paths from a record to its directory, whatever its database or symbolic links contain.

A results directory may come from an untrusted source. Paths are resolved before use, and only regular files of bounded
size are read.
"""

from pathlib import Path

from vsnbench.errors import RecordError

LARGEST_FILE_BYTES = 64 * 2**20
"""Maximum size of an image; a 16-bit PNG of 4096 x 4096 pixels has half of it."""


def confined(root: Path, named: str | Path) -> Path:
    """Return a path inside `root` with all symbolic links resolved.

    Args:
        root: a directory of the record; it may itself be a link.
        named: path in the record, relative to `root`.

    Raises:
        RecordError: the path leads out of `root`.
    """
    try:
        top = root.resolve()
        path = (top / named).resolve()
        path.exists()
    except (OSError, ValueError, RuntimeError) as error:  # too long, a NUL character, or a loop of links
        raise RecordError(f"{root} contains an unusable path ({error}); nothing was changed") from error
    if not path.is_relative_to(top):
        raise RecordError(
            f"the record in {root} contains the path {str(named)[:200]!r}, which leads out of it; nothing was changed: "
            "the record was not written by vsnbench"
        )
    return path


def read_confined(root: Path, named: str | Path) -> bytes | None:
    """Return the content of a file named in the record; None if there is no regular file.

    Raises:
        RecordError: it is outside `root`, larger than LARGEST_FILE_BYTES, or cannot be read.
    """
    path = confined(root, named)
    if not path.is_file():  # a directory, a device or a pipe, which would block
        return None
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE_BYTES + 1)
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror or error}") from error
    if len(content) > LARGEST_FILE_BYTES:
        raise RecordError(f"{path} is larger than {LARGEST_FILE_BYTES // 2**20} MiB, the limit for images")
    return content
