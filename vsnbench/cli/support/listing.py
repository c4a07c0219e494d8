"""Prints lists to the terminal: rows under headings, fitted to its width.

Numbers and dates are never broken. If there is no room for all columns, the least important ones are left out and named
below the list; then long names are cut in the middle, since they differ at their ends, and prose wraps. Pipes
and files get everything.
"""

import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from vsnbench.cli.support.terminal import page
from vsnbench.report.table import Column, dropped_first

if TYPE_CHECKING:
    from rich.text import Text

_GAP = 2
"""Spaces between two columns."""


def name_column(heading: str, min_width: int = 16) -> Column:
    """Return a column of names of any length."""
    return Column(heading, number=False, min_width=min_width)


def prose_column(heading: str, rank: int = 0) -> Column:
    """Return a column of sentences."""
    return Column(heading, number=False, min_width=24, wraps=True, rank=rank)


def print_list(columns: Sequence[Column], rows: Sequence[Sequence[str]]) -> None:
    """Print a list.

    Args:
        columns: from left to right.
        rows: a cell for each column, in rich's markup; the caller escapes text from the record.
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
            justify="right" if column.number else "left",
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
        sys.stderr.write(f"left out for lack of width: {', '.join(left_out)}; use a wider terminal or --json\n")


def _cut(cell: "Text", width: int) -> "Text":
    """Return a cell cut to a width: `a-very-lo…-v2.1`; unchanged if it fits."""
    if cell.cell_len <= width or cell.cell_len != len(cell):  # the table cuts wide characters
        return cell
    end = (width - 1) // 2
    return cell[: width - 1 - end] + "…" + cell[len(cell) - end :]


def _fitted(columns: Sequence[Column], longest: Sequence[int], room: int) -> Mapping[int, int]:
    """Return the index of each column that is printed, with its width."""
    widths = {
        place: min(length, columns[place].min_width) if columns[place].min_width else length
        for place, length in enumerate(longest)
    }

    def left() -> int:
        return room - sum(widths.values()) - _GAP * (len(widths) - 1)

    while left() < 0 and (least := dropped_first(columns, widths)) is not None:
        del widths[least]
    narrowed = sorted((place for place in widths if widths[place] < longest[place]), key=lambda place: longest[place])
    for number, place in enumerate(narrowed):
        share = max(left(), 0) // (len(narrowed) - number)
        widths[place] += min(share, longest[place] - widths[place])
    return widths
