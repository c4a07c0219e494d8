"""Temporary directories that are removed with their owner, or by the next owner if a process was killed.

They are in one directory per user, which no other user can enter. Beside each is a lock file with its inode. Only
directories with such a file are removed: whatever else a user puts there stays.
"""

import fcntl
import os
import shutil
import stat
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Self

_LOCK = ".lock"


def private_temporary_directory() -> Path | None:
    """Return the user's own directory in $TMPDIR, the same for every process; None if there is none.

    Its content is trusted, so a directory of this name that belongs to another user, or that others can enter, is not
    used.
    """
    path = Path(tempfile.gettempdir()) / f"vsnbench-{os.getuid()}"
    try:
        with suppress(FileExistsError):
            path.mkdir(mode=0o700)
        found = path.lstat()
    except OSError:
        return None
    is_ours = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o077
    return path if is_ours and os.access(path, os.W_OK | os.X_OK) else None


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
        parent = private_temporary_directory()
        if parent is None:
            # The user's directory cannot be used: this one is not found by others, and is left behind by a kill.
            parent = Path(tempfile.gettempdir())
        else:
            for lock in parent.glob(f"{purpose}-*{_LOCK}"):
                _clear_if_left_behind(lock)
        self._lock, self._held = _new_lock(parent, purpose)
        self.path = self._lock.with_suffix("")
        self.path.mkdir(mode=0o700)
        os.write(self._held, _identity(self.path.lstat()))

    def remove(self) -> None:
        """Remove the directory with its content; can be called again."""
        if self._held < 0:
            return
        shutil.rmtree(self.path, ignore_errors=True)
        self._lock.unlink(missing_ok=True)
        os.close(self._held)
        self._held = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.remove()


def _new_lock(parent: Path, purpose: str) -> tuple[Path, int]:
    """Create a lock file that this process holds."""
    while True:
        held, name = tempfile.mkstemp(prefix=f"{purpose}-", suffix=_LOCK, dir=parent)
        fcntl.flock(held, fcntl.LOCK_EX)
        if os.fstat(held).st_nlink:  # otherwise another process has taken it for an abandoned one
            return Path(name), held
        os.close(held)


def _clear_if_left_behind(lock: Path) -> None:
    """Remove the directory of a lock that no process holds."""
    with suppress(OSError):  # locked, not a file, or just removed by its owner
        held = os.open(lock, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            found = os.fstat(held)
            if not stat.S_ISREG(found.st_mode) or found.st_uid != os.getuid():
                return
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            directory = lock.with_suffix("")
            identity = os.read(held, 100)
            with suppress(FileNotFoundError):
                if not identity:  # its owner was killed before it used the directory
                    directory.rmdir()
                elif _identity(directory.lstat()) == identity:
                    shutil.rmtree(directory, ignore_errors=True)
            lock.unlink()
        finally:
            os.close(held)


def _identity(found: os.stat_result) -> bytes:
    """Return what identifies a directory; a copy of it, or another one under its name, has another identity."""
    return f"{found.st_dev} {found.st_ino}\n".encode()
