"""Fixtures of the page tests."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.web.page_session import PageSession, page_session


@pytest.fixture
def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[PageSession]:
    """A session with its page, with a time limit for undo that no slow machine reaches."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("vsnbench.runner.judging.corrections.UNDO_S", 1000.0)
    with page_session(tmp_path) as served:
        yield served
