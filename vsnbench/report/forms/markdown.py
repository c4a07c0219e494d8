"""Sheets as Markdown tables (the pipe tables of GitHub and Pandoc)."""

import re
from collections.abc import Iterable

from vsnbench.harmless_text import harmless
from vsnbench.report.sheets import Cell, Row, Sheet, footnotes_of


def markdown(sheets: Iterable[Sheet]) -> str:
    """Return the sheets as Markdown; columns line up in a fixed-width editor too."""
    sheets = list(sheets)
    footnotes = [f"- {escaped(words)}" for words in footnotes_of(sheets)]
    return "\n\n".join([*map(_sheet, sheets), *(["\n".join(footnotes)] if footnotes else [])]) + "\n"


def escaped(text: str) -> str:
    """Return text that no Markdown renderer takes for markup or HTML."""
    return re.sub(r"([\\`*_{}\[\]<>|#~$&])", r"\\\1", harmless(text))


def _sheet(sheet: Sheet) -> str:
    headings = [escaped(column.heading) for column in sheet.columns]
    lines = [[_cell(cell, row) for cell in row.cells] for row in sheet.rows]
    widths = [max(3, *(len(line[place]) for line in [headings, *lines])) for place in range(len(headings))]

    def line(cells: list[str]) -> str:
        set_cells = (
            cell.rjust(width) if column.number else cell.ljust(width)
            for cell, width, column in zip(cells, widths, sheet.columns, strict=True)
        )
        return f"| {' | '.join(set_cells)} |"

    rule = [
        "-" * (width - 1) + ":" if column.number else "-" * width
        for width, column in zip(widths, sheet.columns, strict=True)
    ]
    notes = [f"\n{escaped(note)}" for note in sheet.notes]
    return "\n".join([f"### {escaped(sheet.title)}\n", line(headings), line(rule), *map(line, lines), *notes])


def _cell(cell: Cell, row: Row) -> str:
    text = escaped(cell.text)
    return f"**{text}**" if row.total and text else text
