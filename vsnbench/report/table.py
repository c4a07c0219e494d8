"""Table model of a report, independent of the output format, and its terminal output."""

import math
import textwrap
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from vsnbench.text.distances import distance_text
from vsnbench.text.sanitize import sanitize

if TYPE_CHECKING:
    from rich.table import Table

    from vsnbench.statistics.rates import Interval, Proportion
    from vsnbench.text.terminal import Console

UNKNOWN = "–"
"""Text of a cell without a value."""
_WRAP = 16
"""Width in characters at which a text column may wrap on a terminal."""
_GAP = 2
"""Characters between columns on a terminal."""
_EDGES = 2
"""Characters left and right of a table on a terminal."""


@dataclass(frozen=True, slots=True)
class Column:
    """Heading of a column; numbers are right-aligned."""

    heading: str
    number: bool = True
    note: str = ""
    """Explanation of the heading."""
    rank: int = 0
    """Columns with the highest rank are dropped first if the table is too wide; rank 0 is always shown."""
    min_width: int = 0
    """Number of characters to which a list may narrow the column; 0 if it may not."""
    wraps: bool = False
    """Whether a list wraps long cells; otherwise it cuts them."""


@dataclass(frozen=True, slots=True)
class TableCell:
    """A text, with a sort value if the text would sort wrongly."""

    text: str
    value: float | str | None = None
    links: tuple[int, ...] = ()
    """Numbers of the episodes that the text lists, which the page links."""

    @property
    def key(self) -> float | str:
        """Sort key."""
        return self.text if self.value is None else self.value


@dataclass(frozen=True, slots=True)
class Row:
    """A row of a table; totals are separated from the other rows."""

    cells: tuple[TableCell, ...]
    total: bool = False


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table with a title, notes and footnotes."""

    name: str
    """Identifier for file names, anchors and labels."""
    title: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = field(default=())
    footnotes: tuple[str, ...] = field(default=())
    """Explanations of the names in the table; each is printed once per document."""
    condition: int | None = None
    """Number of the condition, if the table is about only one."""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row.cells) != len(self.columns):
                raise ValueError(
                    f"table {self.name}: a row of {len(row.cells)} cells under {len(self.columns)} columns"
                )


EMPTY = TableCell(UNKNOWN, -math.inf)
"""A dash, which sorts first."""


def row(*values: TableCell | str | int | None, total: bool = False) -> Row:
    """Return a row of cells, texts and integers; None is a dash."""
    return Row(tuple(value if isinstance(value, TableCell) else _cell(value) for value in values), total)


def _cell(value: str | int | None) -> TableCell:
    if value is None:
        return EMPTY
    return TableCell(value) if isinstance(value, str) else TableCell(str(value), value)


def of(part: int, whole: int) -> TableCell:
    """Return a cell like 22/75, sorted by the ratio."""
    return TableCell(f"{part}/{whole}", part / whole if whole else -1.0)


def decimal(number: float, places: int) -> TableCell:
    """Return a cell with a fixed number of decimals, or a dash for NaN, which sorts first."""
    return TableCell(f"{number:.{places}f}", number) if math.isfinite(number) else EMPTY


def goal_distance(distance_m: float, success_distance_m: float | None) -> TableCell:
    """Return a cell with a distance to the goal, rounded so that it stays on its side of the success distance."""
    if not math.isfinite(distance_m):
        return EMPTY
    return TableCell(distance_text(distance_m, success_distance_m), distance_m)


def percent(share: float, places: int = 2) -> TableCell:
    """Return a cell with a ratio in percent."""
    return decimal(share * 100, places)


def p_cell(value: float) -> TableCell:
    """Return a cell with a p-value."""
    return TableCell("< 0.001", value) if value < 0.001 else decimal(value, 3)


def interval_cell(interval: "Interval", places: int, factor: int = 1) -> TableCell:
    """Return a cell with an interval times a factor, sorted by its lower end; a dash if it is unknown."""
    if not interval.known:
        return EMPTY
    return TableCell(f"[{interval.low * factor:.{places}f}, {interval.high * factor:.{places}f}]", interval.low)


def interval_percent(interval: "Interval", places: int = 2) -> TableCell:
    """Return a cell with an interval in percent, sorted by its lower end."""
    return interval_cell(interval, places, 100)


def rate_cells(
    proportion: "Proportion", interval: "Interval", places: int = 2
) -> tuple[TableCell, TableCell, TableCell]:
    """Return the cells of k/n, success rate and its interval in percent."""
    return (
        of(proportion.successes, proportion.trials),
        percent(proportion.rate, places),
        interval_percent(interval, places),
    )


def footnotes_of(tables: Iterable[ReportTable]) -> tuple[str, ...]:
    """Return the footnotes of several tables without repetitions."""
    return tuple(dict.fromkeys(words for table in tables for words in table.footnotes))


def fitted(table: ReportTable, fits: Callable[[ReportTable], bool]) -> ReportTable:
    """Return the table without the columns that do not fit, highest rank first.

    Args:
        table: its columns of rank 0 are always kept.
        fits: whether a table fits.
    """
    while not fits(table) and (least := dropped_first(table.columns, range(len(table.columns)))) is not None:
        table = _with_columns(table, [place for place in range(len(table.columns)) if place != least])
    return table


def dropped_first(columns: Sequence[Column], places: Iterable[int]) -> int | None:
    """Return which of the columns at these places is left out first; None if all are always shown."""
    least = max(places, key=lambda place: (columns[place].rank, place))
    return least if columns[least].rank else None


def narrowed(table: ReportTable, room: int) -> ReportTable:
    """Return a table for a terminal of this width, with a note about the columns that do not fit.

    Headings wrap first, then the columns of the highest rank are dropped.
    """
    if _width(table) <= room:
        return table
    compact = fitted(_with_wrapped_headings(table), lambda part: _width(part) <= room)
    kept = {_one_line(column.heading) for column in compact.columns}
    dropped = [column.heading for column in table.columns if column.heading not in kept]
    if not dropped:
        return compact
    note = f"Left out at this width: {', '.join(dropped)}; use a wider terminal or --json."
    return replace(compact, notes=(note, *compact.notes))


def _with_wrapped_headings(table: ReportTable) -> ReportTable:
    """Wrap the headings of numbers between words to the width of the numbers."""
    columns = []
    for place, column in enumerate(table.columns):
        words = column.heading.split(" ")
        room = max(max((len(row.cells[place].text) for row in table.rows), default=0), *map(len, words))
        heading = "\n".join(textwrap.wrap(column.heading, room)) if column.number else column.heading
        columns.append(replace(column, heading=heading))
    return replace(table, columns=tuple(columns))


def _one_line(heading: str) -> str:
    return heading.replace("\n", " ")


def without_empty_columns(table: ReportTable) -> ReportTable:
    """Return the table without the columns that have no values."""
    known = [
        place
        for place in range(len(table.columns))
        if not table.rows or any(row.cells[place].text != UNKNOWN for row in table.rows)
    ]
    return _with_columns(table, known)


def _with_columns(table: ReportTable, places: Sequence[int]) -> ReportTable:
    return replace(
        table,
        columns=tuple(table.columns[place] for place in places),
        rows=tuple(replace(row, cells=tuple(row.cells[place] for place in places)) for row in table.rows),
    )


def print_tables(tables: Iterable[ReportTable], console: "Console") -> None:
    """Print the tables; text from the record is never interpreted as markup."""
    from rich.text import Text

    tables = list(tables)
    for table in tables:
        shown = narrowed(table, console.width)
        console.print(_rich_table(shown))
        for note in shown.notes:
            console.print(Text(sanitize(note), style="dim"))
        console.print()
    for words in footnotes_of(tables):
        console.print(Text(sanitize(words), style="dim"))


def _rich_table(table: ReportTable) -> "Table":
    from rich import box
    from rich.table import Table
    from rich.text import Text

    title = Text(sanitize(table.title), style="bold")
    printed = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for column, longest in zip(table.columns, _longest_words(table), strict=True):
        # Numbers are never wrapped. On a narrow terminal text wraps between words, and only long names are broken.
        printed.add_column(
            Text("\n".join(map(sanitize, column.heading.split("\n")))),
            justify="right" if column.number else "left",
            no_wrap=column.number,
            overflow="fold",
            min_width=min(_WRAP, longest),
        )
    for index, row in enumerate(table.rows):
        if row.total and index and not table.rows[index - 1].total:
            printed.add_section()
        printed.add_row(*(Text(sanitize(cell.text)) for cell in row.cells), style="bold" if row.total else "")
    return printed


def _texts(table: ReportTable) -> list[list[str]]:
    """Return the texts of each column, the lines of the heading first."""
    return [
        [*column.heading.split("\n"), *(sanitize(row.cells[place].text) for row in table.rows)]
        for place, column in enumerate(table.columns)
    ]


def _longest_words(table: ReportTable) -> list[int]:
    return [max((len(word) for text in column for word in text.split()), default=0) for column in _texts(table)]


def _width(table: ReportTable) -> int:
    # Text columns may wrap, numbers may not.
    widest = [
        max(map(len, words)) if column.number else min(_WRAP, max(map(len, words)))
        for column, words in zip(table.columns, _texts(table), strict=True)
    ]
    return sum(widest) + _GAP * (len(widest) - 1) + _EDGES
