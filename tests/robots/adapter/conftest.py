"""Time for adapters on a busy machine."""

import pytest

from vsnbench.robots.adapter import connection


@pytest.fixture(autouse=True)
def _patient_client(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait long for a progress: nothing here moves in real time."""
    monkeypatch.setattr(connection, "PROGRESS_S", 30.0)
