"""Atomic file writes: a file is written under a temporary name in its directory, then renamed.

All files of the package that other processes may read are written here. Names that end in `PART` belong to no finished
file, so that leftovers of killed processes can be removed.
"""

import contextlib
import fnmatch
import glob
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vsnbench.errors import RecordError, VsnbenchError

PART = ".part"
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL
"""Flags that create a new file and do not follow a link under its name."""


def part_path(path: Path) -> Path:
    """Return the temporary name of a file in this process: hidden, in the same directory."""
    return path.with_name(_part_name(path.name))


def _part_name(name: str) -> str:
    return f".{name}.{os.getpid()}{PART}"


@contextmanager
def atomic_file(path: Path, error: type[VsnbenchError] = RecordError) -> Iterator[Path]:
    """Yield a temporary path that is renamed to `path` when the block ends without an error.

    Missing directories are created. An existing file at `path` stays until then. What a killed process left under a
    temporary name of this file is removed.

    Raises:
        VsnbenchError: the file cannot be written; nothing is left behind.
    """
    part = part_path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        sweep_parts(path.parent, glob.escape(path.name))
        part.unlink(missing_ok=True)
        yield part
        part.replace(path)
    except OSError as refused:
        raise _refusal(path, refused, error) from refused
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def write_atomic(path: Path, content: bytes, error: type[VsnbenchError] = RecordError) -> None:
    """Write a file's content; readers see all of it or nothing.

    This runs concurrently with robot control and uses text paths, because `Path` operations take as long as the write.

    Raises:
        VsnbenchError: the file cannot be written; nothing is left behind.
    """
    whole = os.fspath(path)
    folder, slash, name = whole.rpartition("/")
    part = f"{folder}{slash}{_part_name(name)}"
    try:
        try:
            descriptor = os.open(part, _NEW, 0o666)
        except (FileNotFoundError, FileExistsError):  # no directory, or a leftover file of a dead process
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
    """Remove temporary files of dead processes on this machine; files of running processes stay.

    `of` is the name, or a glob pattern of the names, of the final files.
    """
    with contextlib.suppress(OSError):
        for part in directory.rglob(f".{of}.*{PART}") if below else _parts_in(directory, of):
            if _is_abandoned(part):
                part.unlink(missing_ok=True)


def sweep_part_directory(directory: Path) -> None:
    """Remove a directory with a name of `part_path` that a dead process of this machine was filling."""
    if _is_abandoned(directory) and not directory.is_symlink():
        shutil.rmtree(directory, ignore_errors=True)


def _is_abandoned(part: Path) -> bool:
    """Whether the process that wrote it has ended."""
    owner = part.name.removesuffix(PART).rpartition(".")[2]
    return owner.isdecimal() and not Path(f"/proc/{owner}").exists()


def _parts_in(directory: Path, of: str) -> list[Path]:
    """Return the matches of a pattern, five times as fast as `glob`: a results directory has thousands of
    subdirectories.
    """
    with os.scandir(directory) as entries:
        parts = [entry.name for entry in entries if entry.name.endswith(PART)]
    return [directory / name for name in parts if fnmatch.fnmatchcase(name, f".{of}.*{PART}")]
