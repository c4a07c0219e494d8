"""The PostgreSQL of the record's own tests."""

from tests.results.conftest import postgresql, postgresql_server

__all__ = ["postgresql", "postgresql_server"]
