"""Fixture that runs the command line in this process, which saves a second of imports."""

import pytest

from tests.cli.console import Typed, vsnbench


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Typed:
    """Runs `vsnbench` with some arguments."""
    return lambda *words: vsnbench(monkeypatch, capsys, *words)
