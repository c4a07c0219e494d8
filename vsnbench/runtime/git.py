"""Commit of a source file in a git checkout."""

import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path

_PATIENCE_S = 5


@dataclass(frozen=True, slots=True)
class Checkout:
    """State of a checkout; empty for code outside a checkout."""

    commit: str = ""
    """`unknown` if git failed."""
    dirty: bool = False
    """Whether tracked files differ from the commit."""


@cache
def checkout_of(file: Path) -> Checkout:
    """Return the state of the checkout that tracks `file`, cached per process."""
    directory = file.resolve().parent
    if not any((above / ".git").exists() for above in (directory, *directory.parents)):
        return Checkout()
    try:
        if not _git(directory, "ls-files", "--", file.resolve().name):
            return Checkout()  # an installed package inside a checkout of something else
        commit = _git(directory, "rev-parse", "HEAD")
        return Checkout(commit, bool(_git(directory, "status", "--porcelain", "--untracked-files=no")))
    except (OSError, subprocess.SubprocessError):
        return Checkout("unknown")


def _git(directory: Path, *arguments: str) -> str:
    done = subprocess.run(
        ["git", "-C", str(directory), *arguments], capture_output=True, text=True, check=True, timeout=_PATIENCE_S
    )
    return done.stdout.strip()
