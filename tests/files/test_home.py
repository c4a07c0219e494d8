"""`~user` in paths from the command line and the environment."""

from pathlib import Path

import pytest

from vsnbench.errors import UsageError
from vsnbench.files.home import expanded
from vsnbench.results.files.directory import ResultsDirectory


def test_a_home_directory_replaces_the_tilde(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/ada")
    assert expanded("~/results") == Path("/home/ada/results")
    assert expanded(Path("a/~b")) == Path("a/~b")


def test_the_home_of_an_unknown_user_is_refused() -> None:
    with pytest.raises(UsageError) as refused:
        ResultsDirectory.locate(Path("~nosuchuser/x"))
    assert refused.value.code == "no-home-directory"
    assert "./~nosuchuser" in refused.value.advice
