"""Whether other users of this machine could have written a file."""

import grp
import os
import pwd
import stat
from pathlib import Path


def writers_other_than_us(file: Path) -> str:
    """Return a statement that names which other users can write a file; empty if none can.

    Root is trusted, and the user who called sudo. A world-writable directory is accepted if it has the
    sticky bit, which stops other users from replacing our files.

    Raises:
        OSError: the file cannot be examined.
    """
    folder = file.parent.stat()
    for path, found in ((file, file.lstat()), (file, file.stat()), (file.parent, folder)):
        if found.st_uid not in _trusted_users():
            return f"{path} belongs to {_user_name(found.st_uid)}"
        is_sticky = path == file.parent and bool(found.st_mode & stat.S_ISVTX)
        if not stat.S_ISLNK(found.st_mode) and not is_sticky and _is_writable_by_others(found):
            return f"{path} can be written by other users"
    return ""


def _trusted_users() -> set[int]:
    users = {0, os.geteuid()}
    if os.geteuid() == 0 and os.environ.get("SUDO_UID", "").isdecimal():
        users.add(int(os.environ["SUDO_UID"]))
    return users


def _is_writable_by_others(found: os.stat_result) -> bool:
    if found.st_mode & stat.S_IWOTH:
        return True
    return bool(found.st_mode & stat.S_IWGRP) and not _is_own_group(found.st_gid, found.st_uid)


def _is_own_group(group: int, user: int) -> bool:
    """Return whether a group has only this user: distributions create one for each user, with the user's name."""
    try:
        owner, found = pwd.getpwuid(user), grp.getgrgid(group)
    except KeyError:
        return False
    return owner.pw_gid == group and found.gr_name == owner.pw_name and set(found.gr_mem) <= {owner.pw_name}


def _user_name(user: int) -> str:
    try:
        return f"user {pwd.getpwuid(user).pw_name}"
    except KeyError:
        return f"user {user}"
