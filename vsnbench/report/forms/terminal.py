"""Sheets as tables on a terminal."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from vsnbench.harmless_text import harmless
from vsnbench.report.sheets import Sheet, fitted, footnotes_of

if TYPE_CHECKING:
    from rich.console import Console


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
        for column in sheet.columns:
            # Numbers are never broken; on a narrow terminal it is the words that wrap.
            table.add_column(
                Text(harmless(column.heading)),
                justify="right" if column.number else "left",
                no_wrap=column.number,
                overflow="fold",
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


def _width(sheet: Sheet) -> int:
    texts = [
        [column.heading, *(harmless(row.cells[place].text) for row in sheet.rows)]
        for place, column in enumerate(sheet.columns)
    ]
    # A word column may wrap to some extent, a number must not.
    widest = [
        max(map(len, words)) if column.number else min(_WRAP, max(map(len, words)))
        for column, words in zip(sheet.columns, texts, strict=True)
    ]
    return sum(widest) + 3 * len(widest) + 1


_WRAP = 16
