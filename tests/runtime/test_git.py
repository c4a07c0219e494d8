"""The commit of code: only tracked files of a checkout, and whether they were changed."""

import subprocess
from pathlib import Path

from vsnbench.runtime.git import Checkout, checkout_of


def git(directory: Path, *words: str) -> None:
    subprocess.run(
        ["git", "-C", str(directory), "-c", "user.name=lab", "-c", "user.email=lab@example.org", *words],
        check=True,
        capture_output=True,
    )


def test_tracked_code_has_a_commit_and_code_outside_a_checkout_has_none(tmp_path: Path) -> None:
    outside = tmp_path / "alone.py"
    outside.write_text("")
    assert checkout_of(outside) == Checkout()
    lab = tmp_path / "lab"
    lab.mkdir()
    git(lab, "init", "-q")
    for name in ("policy.py", "net.py", "other.py"):
        (lab / name).write_text("a = 1\n")
    git(lab, "add", "policy.py", "net.py")
    git(lab, "commit", "-qm", "first")
    clean = checkout_of(lab / "policy.py")
    assert len(clean.commit) == 40
    assert not clean.dirty
    assert checkout_of(lab / "other.py") == Checkout(), "not tracked"
    (lab / "net.py").write_text("a = 2\n")
    checkout_of.cache_clear()
    assert checkout_of(lab / "policy.py") == Checkout(clean.commit, dirty=True)
