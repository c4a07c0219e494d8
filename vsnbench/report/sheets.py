"""A sheet: a table of finished words that every form (Markdown, LaTeX, HTML) only has to set; a terminal's is here."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from vsnbench.harmless_text import harmless

if TYPE_CHECKING:
    from rich.console import Console

UNKNOWN = "–"
"""What stands where there is no number."""
_WRAP = 16
"""Characters at which a column of words may wrap on a terminal."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column's heading; numbers are set flush right."""

    heading: str
    number: bool = True
    note: str = ""
    """What the heading means, for whoever asks."""
    rank: int = 0
    """Where there is no room for all columns, those of the highest rank go first; 0 stays."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A text, and the value it is sorted by where the text would sort wrongly."""

    text: str
    value: float | str | None = None

    @property
    def key(self) -> float | str:
        """What to sort by."""
        return self.text if self.value is None else self.value


@dataclass(frozen=True, slots=True)
class Row:
    """A line of a sheet; a total is set apart from what it sums."""

    cells: tuple[Cell, ...]
    total: bool = False


@dataclass(frozen=True, slots=True)
class Sheet:
    """A table with a title and what must be said with it."""

    name: str
    """A word for file names, anchors and labels."""
    title: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = field(default=())
    footnotes: tuple[str, ...] = field(default=())
    """What the names in it stand for; a form says each once, however many sheets have it."""
    condition: int | None = None
    """Number of the one condition that it is about."""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row.cells) != len(self.columns):
                raise ValueError(
                    f"sheet {self.name}: a row of {len(row.cells)} cells under {len(self.columns)} columns"
                )


def row(*cells: Cell, total: bool = False) -> Row:
    """Return a row of these cells."""
    return Row(tuple(cells), total)


def word(text: str) -> Cell:
    """A cell of plain words."""
    return Cell(text)


def count(number: int | None) -> Cell:
    """A cell with a whole number; a dash for one that is not known."""
    return Cell(UNKNOWN, -math.inf) if number is None else Cell(str(number), number)


def of(part: int, whole: int) -> Cell:
    """A cell like 22/75; sorted by the share."""
    return Cell(f"{part}/{whole}", part / whole if whole else -1.0)


def decimal(number: float, places: int) -> Cell:
    """A cell with so many decimals; a dash for NaN, sorted before every number."""
    return Cell(f"{number:.{places}f}", number) if math.isfinite(number) else Cell(UNKNOWN, -math.inf)


def percent(share: float, places: int = 2) -> Cell:
    """A cell with a share of 0 to 1 in percent."""
    return decimal(share * 100, places)


def interval_percent(low: float, high: float, places: int = 2) -> Cell:
    """A cell with an interval of shares in percent; sorted by its lower end."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return Cell(UNKNOWN, -math.inf)
    return Cell(f"[{low * 100:.{places}f}, {high * 100:.{places}f}]", low)


def listed(words: Iterable[object]) -> str:
    """Return the words with commas; a dash for none."""
    return ", ".join(str(each) for each in words) or "none"


def footnotes_of(sheets: Iterable[Sheet]) -> tuple[str, ...]:
    """Return the footnotes of several sheets, each once."""
    return tuple(dict.fromkeys(words for sheet in sheets for words in sheet.footnotes))


def fitted(sheet: Sheet, fits: Callable[[Sheet], bool]) -> Sheet:
    """Return the sheet without the columns for which there is no room, the least telling first.

    Args:
        sheet: to be shown; its columns of rank 0 stay.
        fits: whether what is left has room.
    """
    while not fits(sheet):
        highest = max(range(len(sheet.columns)), key=lambda place: (sheet.columns[place].rank, place))
        if sheet.columns[highest].rank == 0:
            break
        sheet = _with_columns(sheet, [place for place in range(len(sheet.columns)) if place != highest])
    return sheet


def kept(sheet: Sheet) -> Sheet:
    """Return the sheet without the columns in which nothing is known."""
    known = [
        place
        for place in range(len(sheet.columns))
        if not sheet.rows or any(row.cells[place].text != UNKNOWN for row in sheet.rows)
    ]
    return _with_columns(sheet, known)


def _with_columns(sheet: Sheet, places: Sequence[int]) -> Sheet:
    return replace(
        sheet,
        columns=tuple(sheet.columns[place] for place in places),
        rows=tuple(replace(row, cells=tuple(row.cells[place] for place in places)) for row in sheet.rows),
    )


def print_sheets(sheets: Iterable[Sheet], console: "Console") -> None:
    """Print the sheets; text from the record is never taken for markup."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    sheets = list(sheets)
    for whole in sheets:
        sheet = fitted(whole, lambda part: _width(part) <= console.width)
        table = Table(
            title=Text(harmless(sheet.title), style="bold"), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False
        )
        for column, longest in zip(sheet.columns, _longest_words(sheet), strict=True):
            # Numbers are never broken; on a narrow terminal words wrap, and none is broken but a long name.
            table.add_column(
                Text(harmless(column.heading)),
                justify="right" if column.number else "left",
                no_wrap=column.number,
                overflow="fold",
                min_width=min(_WRAP, longest),
            )
        for index, row in enumerate(sheet.rows):
            if row.total and index and not sheet.rows[index - 1].total:
                table.add_section()
            table.add_row(*(Text(harmless(cell.text)) for cell in row.cells), style="bold" if row.total else "")
        console.print(table)
        for note in sheet.notes:
            console.print(Text(harmless(note), style="dim"))
        if left_out := [column.heading for column in whole.columns if column not in sheet.columns]:
            words = f"No room here for {', '.join(left_out)}: a wider terminal shows them."
            console.print(Text(harmless(words), style="dim"))
        console.print()
    for words in footnotes_of(sheets):
        console.print(Text(harmless(words), style="dim"))


def _texts(sheet: Sheet) -> list[list[str]]:
    """Return what stands in each column, its heading first."""
    return [
        [column.heading, *(harmless(row.cells[place].text) for row in sheet.rows)]
        for place, column in enumerate(sheet.columns)
    ]


def _longest_words(sheet: Sheet) -> list[int]:
    return [max((len(word) for text in column for word in text.split()), default=0) for column in _texts(sheet)]


def _width(sheet: Sheet) -> int:
    # A word column may wrap to some extent, a number must not.
    widest = [
        max(map(len, words)) if column.number else min(_WRAP, max(map(len, words)))
        for column, words in zip(sheet.columns, _texts(sheet), strict=True)
    ]
    return sum(widest) + 3 * len(widest) + 1
