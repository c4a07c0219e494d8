"""Inserts rows: a new one, or finds the one that is there, also when another process inserts it at the same moment."""

from typing import Any

from sqlalchemy import Connection, insert, select
from sqlalchemy.dialects import postgresql, sqlite

from vsnbench.database.row_encoding import Row
from vsnbench.database.tables import Base


def insert_row(connection: Connection, table: type[Base], row: Row) -> int:
    """Insert a row and return its id."""
    key: Any = connection.execute(insert(table), row).inserted_primary_key
    return int(key[0])


def find_or_insert(connection: Connection, table: type[Base], row: Row, unique: str) -> int:
    """Return the id of the row that has this value in its unique column, inserted if need be.

    Another process that inserts the same at the same moment is waited for, and its row taken.
    """
    columns = table.__table__.c
    wanted = select(columns.id).where(columns[unique] == row[unique])
    found: int | None = connection.execute(wanted).scalar()
    if found is None:
        connection.execute(insert_if_absent(connection, table, [unique]), row)
        found = connection.execute(wanted).scalar_one()
    return found


def insert_if_absent(connection: Connection, table: type[Base], unique: list[str]) -> Any:
    """Return an INSERT that leaves alone what is there already."""
    dialect = postgresql if connection.dialect.name == "postgresql" else sqlite
    return dialect.insert(table).on_conflict_do_nothing(index_elements=unique)
