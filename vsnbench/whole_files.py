"""Files that appear whole or not at all: written under a temporary name beside their own, then renamed.

Every file that the package makes and somebody may read later is written here. A name that ends in `PART` is never
anybody's: what a killed process leaves under one can be removed.
"""

import contextlib
import fnmatch
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vsnbench.errors import RecordError, VsnbenchError

PART = ".part"
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL
"""A file that was not there: nothing is written through a link that waits under its name."""


def part_path(path: Path) -> Path:
    """Return what this process calls a file until it is whole: hidden, beside it, and no other process's."""
    return path.with_name(_part_name(path.name))


def _part_name(name: str) -> str:
    return f".{name}.{os.getpid()}{PART}"


@contextmanager
def whole_file(path: Path, error: type[VsnbenchError] = RecordError) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to; it takes its name when the block ends without an error.

    Folders that are missing are made. Whatever was at `path` stays there until then.

    Args:
        path: the file.
        error: what is raised where the disk refuses.

    Raises:
        VsnbenchError: of the kind `error`, when it cannot be written; nothing is left behind.
    """
    part = part_path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.unlink(missing_ok=True)
        yield part
        part.replace(path)
    except OSError as refused:
        raise _refusal(path, refused, error) from refused
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes, error: type[VsnbenchError] = RecordError) -> None:
    """Write a file's content; readers see all of it or nothing.

    It is done beside a robot's control path, where to handle paths as more than text takes as long as the file itself.

    Raises:
        VsnbenchError: of the kind `error`, when it cannot be written; nothing is left behind.
    """
    whole = os.fspath(path)
    folder, slash, name = whole.rpartition("/")
    part = f"{folder}{slash}{_part_name(name)}"
    try:
        try:
            descriptor = os.open(part, _NEW, 0o666)
        except (FileNotFoundError, FileExistsError):  # no folder yet, or what a process of this number left
            path.parent.mkdir(parents=True, exist_ok=True)
            Path(part).unlink(missing_ok=True)
            descriptor = os.open(part, _NEW, 0o666)
        try:
            try:
                left = memoryview(content)
                while left:
                    left = left[os.write(descriptor, left) :]
            finally:
                os.close(descriptor)
            os.replace(part, whole)  # noqa: PTH105
        except BaseException:
            with contextlib.suppress(OSError):
                Path(part).unlink(missing_ok=True)
            raise
    except OSError as refused:
        raise _refusal(path, refused, error) from refused


def _refusal(path: Path, refused: OSError, error: type[VsnbenchError]) -> VsnbenchError:
    return error(f"cannot write {path}: {refused.strerror or refused}; free some space or look at the permissions")


def sweep_parts(directory: Path, of: str = "*", *, below: bool = False) -> None:
    """Remove what dead processes of this machine left half written; live ones keep theirs.

    Args:
        directory: where to look.
        of: name, or pattern of names, of the files that were being written.
        below: look in its sub-directories too, however deep.
    """
    with contextlib.suppress(OSError):
        for part in directory.rglob(f".{of}.*{PART}") if below else _parts_in(directory, of):
            if _is_abandoned(part):
                part.unlink(missing_ok=True)


def sweep_part_directory(directory: Path) -> None:
    """Remove a directory that a dead process of this machine was filling under a name of `part_path`."""
    if _is_abandoned(directory) and not directory.is_symlink():
        shutil.rmtree(directory, ignore_errors=True)


def _is_abandoned(part: Path) -> bool:
    """Whether whoever was writing it is gone."""
    owner = part.name.removesuffix(PART).rpartition(".")[2]
    return owner.isdecimal() and not Path(f"/proc/{owner}").exists()


def _parts_in(directory: Path, of: str) -> list[Path]:
    """Return what a glob would, five times as fast: a results directory has thousands of folders to look into."""
    with os.scandir(directory) as entries:
        parts = [entry.name for entry in entries if entry.name.endswith(PART)]
    return [directory / name for name in parts if fnmatch.fnmatchcase(name, f".{of}.*{PART}")]
