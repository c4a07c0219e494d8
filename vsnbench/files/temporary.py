"""Temporary directories that are removed with their owner, or by the next owner if a process was killed."""

import fcntl
import os
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Self


class ScratchDirectory:
    """Directory that only this user can enter; removes those that killed owners with the same purpose left.

    The kernel releases its lock when the process ends. Containers that share the disk see locks, whereas process ids
    have no meaning there.
    """

    def __init__(self, purpose: str) -> None:
        """Create a directory with the purpose in its name.

        Raises:
            OSError: the disk is full or not writable.
        """
        prefix = f"vsnbench-{purpose}-"
        for other in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
            _clear_if_left_behind(other)
        not_held_yet = Path(tempfile.mkdtemp(prefix=f".{prefix}"))
        self._held = os.open(not_held_yet, os.O_RDONLY | os.O_DIRECTORY)
        fcntl.flock(self._held, fcntl.LOCK_EX)
        self.path = not_held_yet.rename(not_held_yet.with_name(not_held_yet.name[1:]))

    def remove(self) -> None:
        """Remove the directory with its content; can be called again."""
        shutil.rmtree(self.path, ignore_errors=True)
        if self._held >= 0:
            os.close(self._held)
            self._held = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.remove()


def _clear_if_left_behind(directory: Path) -> None:
    with suppress(OSError):  # locked, another user's, not a directory, or just removed by its owner
        held = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(directory, ignore_errors=True)
        finally:
            os.close(held)
