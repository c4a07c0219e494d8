"""The command line as a test types it, within this process: a process of its own costs a second of imports."""

from collections.abc import Callable

import pytest

from tests.cli.console import Answer, vsnbench


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Answer]:
    """Types words after `vsnbench`."""
    return lambda *words: vsnbench(monkeypatch, capsys, *words)
