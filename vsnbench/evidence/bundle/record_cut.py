"""Copies the rows of some campaigns to a new SQLite file whose bytes depend only on them and on SQLite's version.

Numbers and UUIDs are kept. Which rows belong to a campaign follows from the foreign keys: rows that refer to it, rows
that refer to those, and everything that these refer to.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import Any

from sqlalchemy import (
    Column,
    ColumnElement,
    Connection,
    MetaData,
    String,
    Table,
    event,
    false,
    func,
    insert,
    or_,
    select,
)
from sqlalchemy.schema import CreateIndex, CreateTable

from vsnbench.errors import RecordError
from vsnbench.evidence.bundle.selection import BundleSelection
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.reading.episode_numbers import ReleasedClaim, missing_numbers
from vsnbench.results.schema.base import TableBase
from vsnbench.results.schema.engine import opened_engine, transaction
from vsnbench.results.schema.migrate import HEAD
from vsnbench.results.schema.row_encoding import Row
from vsnbench.results.schema.study_tables import Study
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow

_AT_ONCE = 500
_PAGE_BYTES = 4096


def cut_record(source: Connection, selection: BundleSelection, target: Path, *, with_images: bool) -> None:
    """Write the selected part of a record to a new file.

    Its directory must have room for a second copy during the work.

    Raises:
        RecordError: the file cannot be written.
    """
    draft = target.with_name(f"{target.name}.draft")
    with opened_engine(sqlite_url(draft)) as engine:
        event.listen(engine, "connect", _without_foreign_keys)
        with transaction(engine) as copy:
            _create_tables(copy)
            for table in TableBase.metadata.sorted_tables:
                for rows in _parts(source, table, selection):
                    if table is EpisodeRow.__table__ and not with_images:
                        rows = [{**row, "images_directory": ""} for row in rows]  # noqa: PLW2901
                    copy.execute(insert(table), rows)
            _explain_gaps(source, copy)
            if wrong := copy.exec_driver_sql("PRAGMA foreign_key_check").first():
                raise RecordError(f"a row of {wrong[0]} in the record refers to a missing row of {wrong[2]}")
    try:
        with closing(sqlite3.connect(draft)) as database:
            database.execute("PRAGMA journal_mode = DELETE")
            database.execute(f"PRAGMA page_size = {_PAGE_BYTES}")
            database.execute("VACUUM INTO ?", [str(target)])
    except sqlite3.Error as error:
        raise RecordError(f"cannot write {target}: {error}", advice="free some space") from error
    draft.unlink()


def _without_foreign_keys(connection: sqlite3.Connection, _record: object) -> None:
    connection.execute("PRAGMA foreign_keys = OFF")  # rows are checked at the end, whatever the order of the tables


def _create_tables(copy: Connection) -> None:
    """Create the tables; migrations write the constraints in another order in every process."""
    for table in TableBase.metadata.sorted_tables:
        copy.execute(CreateTable(table))
        for index in sorted(table.indexes, key=lambda index: str(index.name)):
            copy.execute(CreateIndex(index))
    version = Table("alembic_version", MetaData(), Column("version_num", String(32), primary_key=True))
    copy.execute(CreateTable(version))
    copy.execute(insert(version), {"version_num": HEAD})


def _parts(source: Connection, table: Table, selection: BundleSelection) -> Iterator[list[Row]]:
    query = select(table).where(_belongs(table, selection)).order_by(*table.primary_key.columns)
    rows = source.execution_options(yield_per=_AT_ONCE).execute(query).mappings()
    for part in rows.partitions():
        yield [dict(row) for row in part]


def _belongs(table: Table, selection: BundleSelection) -> ColumnElement[bool]:
    """Return which rows of a table belong to a selection."""
    (key, *_) = table.primary_key.columns
    if table is CampaignRow.__table__:
        return key.in_(selection.campaigns)
    if table is Study.__table__:
        return key == selection.study
    if table in _owned():
        references = [(column, target) for column, target in _references(table) if target.table in _owned()]
        return or_(
            *(column.in_(select(target).where(_belongs(target.table, selection))) for column, target in references)
        )
    users = [
        (column, other)
        for other in TableBase.metadata.sorted_tables
        for column, target in _references(other)
        if target is key
    ]
    uses = (key.in_(select(column).where(_belongs(other, selection), column.is_not(None))) for column, other in users)
    return or_(false(), *uses)


@cache
def _owned() -> frozenset[Table]:
    """Return campaigns, studies, and the tables with rows that belong to one of them."""
    owned: set[Any] = {CampaignRow.__table__, Study.__table__}
    for table in TableBase.metadata.sorted_tables:  # a table comes after those that it refers to
        if any(target.table in owned for _, target in _references(table)):
            owned.add(table)
    return frozenset(owned)


def _references(table: Table) -> list[tuple[Column[Any], Column[Any]]]:
    return [(key.parent, key.column) for key in sorted(table.foreign_keys, key=lambda key: key.parent.name)]


def _explain_gaps(source: Connection, copy: Connection) -> None:
    """Record the numbers of episodes of other campaigns as known gaps; those of deleted episodes stay unexplained."""
    last = copy.scalar(select(func.max(EpisodeRow.id))) or 0
    unexplained = {*copy.scalars(select(EpisodeRow.id)), *missing_numbers(source)}
    gaps = [{"number": number, "released_at": None} for number in range(1, last + 1) if number not in unexplained]
    if gaps:
        copy.execute(insert(ReleasedClaim), gaps)
