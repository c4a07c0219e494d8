"""A list at the terminal: rows under headings, fitted to its width by one rule.

Numbers, dates and words of ours are never broken. Where there is no room for all columns, those that tell least are
left out, and named below; then long names are cut in the middle, since they differ at their ends, and prose wraps. Into
a pipe or a file goes all of it (docs/command-line.md).
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from vsnbench.cli.episode_page import page

if TYPE_CHECKING:
    from rich.text import Text

_GAP = 2
"""Blanks between two columns."""


@dataclass(frozen=True, slots=True)
class ListColumn:
    """A column of a list."""

    heading: str
    right: bool = False
    """Flush right, as numbers are."""
    least: int = 0
    """Where there is no room for its longest cell: to how many characters it may be narrowed; 0 for not at all."""
    wraps: bool = False
    """What is too long for a narrowed column goes on below; else it is cut."""
    rank: int = 0
    """Where there is no room for all columns, those of the highest rank go first; 0 stays."""


def name_column(heading: str, least: int = 16) -> ListColumn:
    """Return a column of names that others have given, of any length."""
    return ListColumn(heading, least=least)


def prose_column(heading: str, rank: int = 0) -> ListColumn:
    """Return a column of sentences."""
    return ListColumn(heading, least=24, wraps=True, rank=rank)


def print_list(columns: Sequence[ListColumn], rows: Sequence[Sequence[str]]) -> None:
    """Print a list.

    Args:
        columns: from left to right.
        rows: a cell for each column, as markup of rich: text from the record is escaped by whoever calls.
    """
    from rich.table import Table
    from rich.text import Text

    console = page()
    cells = [[Text.from_markup(cell) for cell in row] for row in rows]
    longest = [
        max([len(column.heading), *(row[place].cell_len for row in cells)]) for place, column in enumerate(columns)
    ]
    widths = _fitted(columns, longest, console.width)
    table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, _GAP, 0, 0))
    for place, width in widths.items():
        column = columns[place]
        table.add_column(
            column.heading,
            justify="right" if column.right else "left",
            no_wrap=not column.wraps,
            overflow="fold" if column.wraps else "ellipsis",
            width=width,
        )
    for row in cells:
        table.add_row(
            *(row[place] if columns[place].wraps else _cut(row[place], width) for place, width in widths.items())
        )
    console.print(table)
    if left_out := [column.heading for place, column in enumerate(columns) if place not in widths]:
        sys.stderr.write(f"no room here for {', '.join(left_out)}: a wider terminal or --json shows more\n")


def _cut(cell: "Text", width: int) -> "Text":
    """Return a cell of at most so many characters: `a-very-lo…-v2.1`; one that fits as it is."""
    if cell.cell_len <= width or cell.cell_len != len(cell):  # wide letters are left to the table
        return cell
    end = (width - 1) // 2
    return cell[: width - 1 - end] + "…" + cell[len(cell) - end :]


def _fitted(columns: Sequence[ListColumn], longest: Sequence[int], room: int) -> Mapping[int, int]:
    """Return the places of the columns that are shown, each with its width."""
    widths = {
        place: min(length, columns[place].least) if columns[place].least else length
        for place, length in enumerate(longest)
    }

    def left() -> int:
        return room - sum(widths.values()) - _GAP * (len(widths) - 1)

    while left() < 0:
        place = max(widths, key=lambda place: (columns[place].rank, place))
        if columns[place].rank == 0:
            break
        del widths[place]
    narrowed = sorted((place for place in widths if widths[place] < longest[place]), key=lambda place: longest[place])
    for number, place in enumerate(narrowed):
        share = max(left(), 0) // (len(narrowed) - number)
        widths[place] += min(share, longest[place] - widths[place])
    return widths
