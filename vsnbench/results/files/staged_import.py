"""Staged import of episode files: copied under a temporary name and moved into place before their rows are committed.

A directory in place has a mark file until its episode's row is committed. If the process is killed in between, the next
program uses the marks to decide which directories belong to recorded episodes, and removes the others.
"""

import contextlib
import os
import shutil
import socket
import stat
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Self

from vsnbench.errors import RecordError
from vsnbench.files.atomic import PART
from vsnbench.results.files.confined_paths import confined

MARK = ".arriving"
"""Mark file of an episode directory without a committed row: owner and UUID of the episode."""
_STAGE = ".arrivals."
_DEEPEST = 2
"""An episode directory contains files and one level of folders (`rgb/0001.jpg`)."""
_AT_ONCE_BYTES = 2**20


FindRecorded = Callable[[Collection[str]], Mapping[str, str]]
"""Returns the image directories of those UUIDs that are committed in the record."""


class StagedImport:
    """Context manager that copies files into a results directory without leaving partial imports.

    `copy` copies each episode's files under a temporary name; `place` moves them into place within the transaction that
    inserts the row. On exit, files of recorded episodes stay and all others are removed.
    """

    def __init__(self, results: Path, find_recorded: FindRecorded) -> None:
        self._results = results
        self._kept = find_recorded
        self._stage = results / f"{_STAGE}{_here()}{PART}"
        self._placed: dict[Path, str] = {}

    def __enter__(self) -> Self:
        with _writing(self._stage):
            shutil.rmtree(self._stage, ignore_errors=True)
            self._stage.mkdir(parents=True)
        return self

    def __exit__(self, *_: object) -> None:
        shutil.rmtree(self._stage, ignore_errors=True)
        with contextlib.suppress(RecordError):  # the next run cleans up if the record is not available
            _resolve(self._results, self._placed, self._kept)

    def room_for(self, uuid: str) -> Path:
        """Return an empty directory for an episode's files.

        Raises:
            RecordError: it cannot be created.
        """
        directory = self._stage / uuid
        with _writing(directory):
            directory.mkdir()
            (directory / MARK).write_text(f"{_here()} {uuid}\n", encoding="utf-8")
        return directory

    def copy(self, uuid: str, root: Path, named: str, files: Iterable[Path]) -> None:
        """Copy an episode's files, from `files_below`, from its directory `named` in another results directory.

        Raises:
            RecordError: a path leads out of `root`, or a file cannot be read or written.
        """
        source, directory = confined(root, named), self.room_for(uuid)
        for file in files:
            target = directory / file
            with _writing(target):
                target.parent.mkdir(exist_ok=True)
                _copy(source / file, target)

    def place(self, uuid: str, images_directory: str) -> None:
        """Move an episode's files to the directory in its uncommitted row.

        Raises:
            RecordError: the target exists.
        """
        target = self._results / images_directory
        clear_unfinished(target)
        with _writing(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            (self._stage / uuid).rename(target)
        self._placed[target] = uuid


def files_below(root: Path, named: str) -> list[Path]:
    """Return the regular files of an episode's directory in an untrusted record, relative to it.

    Links, devices, hidden files and deeper folders are skipped. Empty if the directory does not exist.

    Raises:
        RecordError: the directory is outside `root`, or it cannot be read.
    """
    top = confined(root, named)
    try:
        return sorted(_files(top, Path(), _DEEPEST)) if top.is_dir() else []
    except OSError as error:
        raise RecordError(f"cannot read {top}: {error.strerror or error}; nothing was written") from error


def _files(top: Path, below: Path, deep: int) -> Iterator[Path]:
    with os.scandir(top / below) as entries:
        for entry in entries:
            if entry.name.startswith("."):
                continue
            if entry.is_file(follow_symlinks=False):
                yield below / entry.name
            elif deep > 1 and entry.is_dir(follow_symlinks=False):
                yield from _files(top, below / entry.name, deep - 1)


def _copy(source: Path, target: Path) -> None:
    descriptor = os.open(source, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    with open(descriptor, "rb") as given, target.open("wb") as taken:  # noqa: PTH123 - a descriptor, not a path
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise RecordError(f"{source} is no longer a regular file; nothing was written")
        shutil.copyfileobj(given, taken, _AT_ONCE_BYTES)


def clear_unfinished(directory: Path) -> None:
    """Remove a directory with a mark file, before its number is used for another episode."""
    if (directory / MARK).exists():
        shutil.rmtree(directory, ignore_errors=True)


def remove_stale_imports(results: Path, find_recorded: FindRecorded) -> None:
    """Remove unfinished imports of dead processes of this machine.

    Raises:
        RecordError: the record cannot be read.
    """
    with contextlib.suppress(OSError):
        for stage in results.glob(f"{_STAGE}*{PART}"):
            if _is_dead(stage.name.removeprefix(_STAGE).removesuffix(PART)):
                shutil.rmtree(stage, ignore_errors=True)
    _resolve(
        results, {directory: uuid for directory, owner, uuid in _marked(results) if _is_dead(owner)}, find_recorded
    )


def _resolve(results: Path, marked: Mapping[Path, str], find_recorded: FindRecorded) -> None:
    known = find_recorded(set(marked.values())) if marked else {}
    for directory, uuid in marked.items():
        if known.get(uuid) == directory.relative_to(results).as_posix():
            (directory / MARK).unlink(missing_ok=True)
        else:
            shutil.rmtree(directory, ignore_errors=True)


def _marked(results: Path) -> Iterator[tuple[Path, str, str]]:
    with contextlib.suppress(OSError), os.scandir(results / "episodes") as folders:
        for folder in folders:
            with contextlib.suppress(OSError):
                owner, _, uuid = (Path(folder.path) / MARK).read_text(encoding="utf-8").strip().partition(" ")
                yield Path(folder.path), owner, uuid


def _here() -> str:
    return f"{socket.gethostname()}.{os.getpid()}"


def _is_dead(owner: str) -> bool:
    """Return whether a process, as named by `_here`, is known to be dead."""
    host, _, pid = owner.rpartition(".")
    return host == socket.gethostname() and pid.isdecimal() and not Path(f"/proc/{pid}").exists()


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise RecordError(
            f"cannot import files to {path}: {error.strerror or error}",
            advice="nothing was imported; free some space, or check the permissions and the existing files",
        ) from error
