"""Episode numbers: released claims and unexplained gaps."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import Connection, func, select, text
from sqlalchemy.orm import Mapped, mapped_column

from vsnbench.results.schema.base import TableBase
from vsnbench.results.schema.tables import EpisodeRow


class ReleasedClaim(TableBase):
    """Number of a claim that was released before the episode began."""

    __tablename__ = "released_claim"

    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    released_at: Mapped[datetime | None]
    """NULL for gaps from before this table existed."""


def missing_numbers(connection: Connection) -> tuple[int, ...]:
    """Return the assigned episode numbers that have no row and were not released.

    Empty on PostgreSQL, where every rollback uses up a number.
    """
    if connection.dialect.name != "sqlite":
        return ()
    last = connection.execute(text("SELECT seq FROM sqlite_sequence WHERE name = 'episode'")).scalar() or 0
    last = max(last, connection.execute(select(func.max(EpisodeRow.id))).scalar() or 0)
    known = {*connection.scalars(select(EpisodeRow.id)), *connection.scalars(select(ReleasedClaim.number))}
    return tuple(number for number in range(1, last + 1) if number not in known) if len(known) < last else ()


def as_ranges(numbers: Sequence[int]) -> str:
    """Return ascending numbers as ranges, like `5, 7-9`."""
    ranges: list[list[int]] = []
    for number in numbers:
        if ranges and number == ranges[-1][1] + 1:
            ranges[-1][1] = number
        else:
            ranges.append([number, number])
    return ", ".join(str(first) if first == last else f"{first}-{last}" for first, last in ranges)
