"""A PostgreSQL server on loopback, shared by all tests of a session."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.results.postgresql_server import new_database, running_server
from vsnbench.results.database_url import sqlite_url


@pytest.fixture
def sqlite(tmp_path: Path) -> str:
    return sqlite_url(tmp_path / "vsnbench.db")


@pytest.fixture(scope="session")
def postgresql_server() -> Iterator[str]:
    """The URL of a server without the name of a database."""
    with running_server() as server:
        yield server


@pytest.fixture
def postgresql(postgresql_server: str) -> str:
    """The URL of a fresh, empty database."""
    return new_database(postgresql_server)


@pytest.fixture(params=["sqlite", "postgresql"])
def url(request: pytest.FixtureRequest) -> str:
    """URL of an empty record in each supported database."""
    found = request.getfixturevalue(request.param)
    assert isinstance(found, str)
    return found
