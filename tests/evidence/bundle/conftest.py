"""PostgreSQL fixtures of the record's tests."""

from tests.results.conftest import postgresql, postgresql_server

__all__ = ["postgresql", "postgresql_server"]
