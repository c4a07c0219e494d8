"""Fixture that runs the command line in this process, which saves a second of imports."""

from collections.abc import Callable

import pytest

from tests.cli.console import Answer, vsnbench


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Answer]:
    """Runs `vsnbench` with some arguments."""
    return lambda *words: vsnbench(monkeypatch, capsys, *words)
