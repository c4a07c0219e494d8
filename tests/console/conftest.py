"""The session that pages are looked at with."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.console.desk_session import Session, desk_session


@pytest.fixture
def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Session]:
    """A desk with its page, where a judgement can be taken back however slow the machine is."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("vsnbench.runner.corrections.UNDO_S", 1000.0)
    with desk_session(tmp_path) as served:
        yield served
