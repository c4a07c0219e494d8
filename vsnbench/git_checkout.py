"""Which commit some code is at: asked of git, where the code lies in a checkout that tracks it."""

import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path

_PATIENCE_S = 5


@dataclass(frozen=True, slots=True)
class Checkout:
    """The state of a checkout; empty for code that lies in none."""

    commit: str = ""
    """`unknown` where git could not be asked."""
    dirty: bool = False
    """Tracked files differ from the commit."""


@cache
def checkout_of(file: Path) -> Checkout:
    """Return the state of the checkout that tracks `file`, once a process."""
    directory = file.resolve().parent
    if not any((above / ".git").exists() for above in (directory, *directory.parents)):
        return Checkout()
    try:
        if not _git(directory, "ls-files", "--", file.resolve().name):
            return Checkout()  # installed into an environment that lies in somebody's checkout
        commit = _git(directory, "rev-parse", "HEAD")
        return Checkout(commit, bool(_git(directory, "status", "--porcelain", "--untracked-files=no")))
    except (OSError, subprocess.SubprocessError):
        return Checkout("unknown")


def _git(directory: Path, *words: str) -> str:
    done = subprocess.run(
        ["git", "-C", str(directory), *words], capture_output=True, text=True, check=True, timeout=_PATIENCE_S
    )
    return done.stdout.strip()
