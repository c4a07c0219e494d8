"""Episodes' files that come from elsewhere: copied under a temporary name, in place before their rows are committed.

A directory in place bears a mark until its episode's row is committed. Whoever is killed in between leaves marks: the
next program sees by them which directories belong to an episode of the record, and removes the others.
"""

import contextlib
import os
import shutil
import socket
import stat
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from vsnbench.errors import RecordError
from vsnbench.record.confined import confined
from vsnbench.whole_files import PART

MARK = ".arriving"
"""File in an episode's directory whose row may not be committed yet: who puts it there, and the episode's UUID."""
_STAGE = ".arrivals."
_DEEPEST = 2
"""An episode's directory holds files and folders of files (`rgb/0001.jpg`), nothing deeper."""
_AT_ONCE_BYTES = 2**20


Kept = Callable[[Collection[str]], Mapping[str, str]]
"""Says which of these UUIDs are in the record, each with its images' directory; reads what is committed."""


class Arrivals:
    """Files on their way into a results directory; a context manager that leaves nothing half-done behind.

    `copy` brings each episode's files under a temporary name; `place` puts them where they belong, within the
    transaction that inserts the row. When the block is left, whatever happened in it, the files of episodes that are
    in the record stay, and the others go.

    Args:
        results: the results directory.
        kept: what the record has.
    """

    def __init__(self, results: Path, kept: Kept) -> None:
        self._results = results
        self._kept = kept
        self._stage = results / f"{_STAGE}{_here()}{PART}"
        self._placed: dict[Path, str] = {}

    def __enter__(self) -> Self:
        with _writing(self._stage):
            shutil.rmtree(self._stage, ignore_errors=True)
            self._stage.mkdir(parents=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        shutil.rmtree(self._stage, ignore_errors=True)
        with contextlib.suppress(RecordError):  # a record that does not answer now is asked when the next run begins
            _resolve(self._results, self._placed, self._kept)

    def room_for(self, uuid: str) -> Path:
        """Return an empty directory for an episode's files.

        Raises:
            RecordError: it cannot be made.
        """
        directory = self._stage / uuid
        with _writing(directory):
            directory.mkdir()
            (directory / MARK).write_text(f"{_here()} {uuid}\n", encoding="utf-8")
        return directory

    def copy(self, uuid: str, root: Path, named: str, files: Iterable[Path]) -> None:
        """Copy an episode's files from another results directory.

        Args:
            uuid: the episode's.
            root: the other results directory.
            named: the episode's directory there, as its record names it.
            files: relative to that, from `files_below`.

        Raises:
            RecordError: what is named leads out of `root`, or a file cannot be read or written.
        """
        source, directory = confined(root, named), self.room_for(uuid)
        for file in files:
            target = directory / file
            with _writing(target):
                target.parent.mkdir(exist_ok=True)
                _copy(source / file, target)

    def place(self, uuid: str, images_directory: str) -> None:
        """Put an episode's files where its row, not yet committed, says that they are.

        Raises:
            RecordError: something else lies there.
        """
        target = self._results / images_directory
        clear_unfinished(target)
        with _writing(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            (self._stage / uuid).rename(target)
        self._placed[target] = uuid


def files_below(root: Path, named: str) -> list[Path]:
    """Return the ordinary files of an episode's directory in a record that is not believed, relative to it.

    Links, devices, hidden files and what lies too deep are passed over; none where there is no such directory.

    Raises:
        RecordError: the record names a directory outside `root`, or it cannot be read.
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
            raise RecordError(f"{source} is no ordinary file any more; nothing was written")
        shutil.copyfileobj(given, taken, _AT_ONCE_BYTES)


def clear_unfinished(directory: Path) -> None:
    """Remove a directory that bears the mark of an arrival, before its number is given to another episode."""
    if (directory / MARK).exists():
        shutil.rmtree(directory, ignore_errors=True)


def sweep_arrivals(results: Path, kept: Kept) -> None:
    """Clear away what killed processes of this machine were bringing in; what a live one brings is left alone.

    Args:
        results: the results directory.
        kept: what the record has.

    Raises:
        RecordError: the record cannot be read.
    """
    with contextlib.suppress(OSError):
        for stage in results.glob(f"{_STAGE}*{PART}"):
            if _is_dead(stage.name.removeprefix(_STAGE).removesuffix(PART)):
                shutil.rmtree(stage, ignore_errors=True)
    _resolve(results, {directory: uuid for directory, owner, uuid in _marked(results) if _is_dead(owner)}, kept)


def _resolve(results: Path, marked: Mapping[Path, str], kept: Kept) -> None:
    known = kept(set(marked.values())) if marked else {}
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
    """Say whether a process, as `_here` names it, is known not to live any more."""
    host, _, pid = owner.rpartition(".")
    return host == socket.gethostname() and pid.isdecimal() and not Path(f"/proc/{pid}").exists()


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise RecordError(
            f"cannot bring files to {path}: {error.strerror or error}",
            advice="nothing was taken in; free some space, or look at the permissions and at what lies there",
        ) from error
