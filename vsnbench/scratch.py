"""Directories for the moment, in the system's place for such: gone with their owner, or with the next who wants one."""

import fcntl
import os
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self


class ScratchDirectory:
    """A directory that only this user can enter; what killed owners of the same purpose left is cleared away first.

    The kernel lets its lock go however the process ends; a lock is seen from every container that shares the disk,
    where the number of a process says nothing.
    """

    def __init__(self, purpose: str) -> None:
        """Make one.

        Args:
            purpose: a word for its name.

        Raises:
            OSError: the disk is full, or may not be written.
        """
        prefix = f"vsnbench-{purpose}-"
        for other in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
            _clear_if_left_behind(other)
        not_held_yet = Path(tempfile.mkdtemp(prefix=f".{prefix}"))
        self._held = os.open(not_held_yet, os.O_RDONLY | os.O_DIRECTORY)
        fcntl.flock(self._held, fcntl.LOCK_EX)
        self.path = not_held_yet.rename(not_held_yet.with_name(not_held_yet.name[1:]))

    def remove(self) -> None:
        """Remove it with all that is inside; once more does nothing."""
        shutil.rmtree(self.path, ignore_errors=True)
        if self._held >= 0:
            os.close(self._held)
            self._held = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.remove()


def _clear_if_left_behind(directory: Path) -> None:
    with suppress(OSError):  # held, another user's, no directory, or removed by its owner just now
        held = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(directory, ignore_errors=True)
        finally:
            os.close(held)
