"""Fixtures of the report's tests."""

from pathlib import Path

import pytest

from tests.report.records import Lab
from tests.results.conftest import postgresql, postgresql_server

__all__ = ["lab", "postgresql", "postgresql_server"]


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    """Return an empty record."""
    return Lab(tmp_path)
