"""Starts a program that cannot read some files or use TCP, with the kernel's Landlock; also a script.

Landlock only permits, so everything else is permitted: every file and directory beside the hidden ones and beside the
directories above them. What is created beside those later cannot be read either. Linux 5.19 or later (before, Landlock
refuses to move files from one directory to another); TCP is refused from Linux 6.7 on. `hide_files.py FILES… --
COMMAND…` runs a command in this way.
"""

import ctypes
import os
import sys
from collections.abc import Collection, Sequence
from contextlib import suppress
from pathlib import Path

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
"""Numbers of system calls, the same on every architecture."""
_VERSION = 1
"""Flag of _CREATE_RULESET: return the version."""
_READ_FILE = 1 << 2
_MOVE_BETWEEN_DIRECTORIES = 1 << 13
"""Refused unless permitted; a move that would make a hidden file readable is refused in any case."""
_FIRST_VERSION_WITH_MOVES = 2
_TCP_BIND_AND_CONNECT = 3
_FIRST_VERSION_WITH_TCP = 4
_PATH_BENEATH = 1
_SET_NO_NEW_PRIVILEGES = 38
_END = "--"

_system = ctypes.CDLL(None, use_errno=True)


class _Ruleset(ctypes.Structure):
    _fields_ = (("files", ctypes.c_uint64), ("network", ctypes.c_uint64))


class _Rule(ctypes.Structure):
    _pack_ = 1
    _fields_ = (("allowed", ctypes.c_uint64), ("descriptor", ctypes.c_int32))


def can_hide_files() -> bool:
    """Return whether this kernel's Landlock can hide files and permit all else."""
    return sys.platform == "linux" and _version() >= _FIRST_VERSION_WITH_MOVES


def can_refuse_tcp() -> bool:
    """Return whether this kernel's Landlock can also refuse TCP."""
    return sys.platform == "linux" and _version() >= _FIRST_VERSION_WITH_TCP


def _version() -> int:
    return int(_system.syscall(_CREATE_RULESET, None, 0, _VERSION))


def command_without(hidden: Sequence[Path], command: Sequence[str]) -> list[str]:
    """Return a command for a program that cannot read these files and directories, existing or not, or use TCP."""
    return [sys.executable, "-I", "-S", __file__, *(os.path.realpath(path) for path in hidden), _END, *command]


def _hide(hidden: Collection[str]) -> None:
    """Forbid this process, and all that it starts, to read these files and, if the kernel can, to use TCP.

    Raises:
        OSError: the kernel refuses.
    """
    refused = _Ruleset(_READ_FILE | _MOVE_BETWEEN_DIRECTORIES, _TCP_BIND_AND_CONNECT)
    size = ctypes.sizeof(_Ruleset) if can_refuse_tcp() else _Ruleset.network.offset
    ruleset = _called(_CREATE_RULESET, ctypes.byref(refused), size, 0)
    _permit(ruleset, "/", _MOVE_BETWEEN_DIRECTORIES)
    _permit_beside(ruleset, "/", hidden)
    _system.prctl(_SET_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    _called(_RESTRICT_SELF, ruleset, 0)
    os.close(ruleset)


def _permit_beside(ruleset: int, directory: str, hidden: Collection[str]) -> None:
    try:
        entries = list(os.scandir(directory))
    except OSError:  # this process cannot read it anyway
        return
    for entry in entries:
        if entry.is_symlink() or entry.path in hidden:  # a link may lead above a hidden directory
            continue
        if any(path.startswith(f"{entry.path}/") for path in hidden):
            _permit_beside(ruleset, entry.path, hidden)
            continue
        with suppress(FileNotFoundError):  # just removed
            _permit(ruleset, entry.path, _READ_FILE)


def _permit(ruleset: int, path: str, what: int) -> None:
    descriptor = os.open(path, os.O_PATH | os.O_NOFOLLOW | os.O_CLOEXEC)
    rule = _Rule(what, descriptor)
    _system.syscall(_ADD_RULE, ruleset, _PATH_BENEATH, ctypes.byref(rule), 0)
    os.close(descriptor)


def _called(number: int, *arguments: object) -> int:
    result = int(_system.syscall(number, *arguments))
    if result < 0:
        raise OSError(ctypes.get_errno(), f"Landlock: {os.strerror(ctypes.get_errno())}")
    return result


if __name__ == "__main__":
    end = sys.argv.index(_END)
    _hide(sys.argv[1:end])
    os.execv(sys.argv[end + 1], sys.argv[end + 1 :])  # noqa: S606 - the command of the caller
