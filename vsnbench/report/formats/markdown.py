"""Report tables as Markdown pipe tables (GitHub, Pandoc)."""

import re
from collections.abc import Iterable

from vsnbench.report.table import ReportTable, Row, TableCell, footnotes_of
from vsnbench.text.sanitize import sanitize


def markdown(tables: Iterable[ReportTable]) -> str:
    """Return the tables as Markdown with aligned columns."""
    tables = list(tables)
    footnotes = [f"- {escaped(words)}" for words in footnotes_of(tables)]
    return "\n\n".join([*map(_table_lines, tables), *(["\n".join(footnotes)] if footnotes else [])]) + "\n"


def escaped(text: str) -> str:
    """Escape text for Markdown and HTML."""
    return re.sub(r"([\\`*_{}\[\]<>|#~$&])", r"\\\1", sanitize(text))


def _table_lines(table: ReportTable) -> str:
    headings = [escaped(column.heading) for column in table.columns]
    lines = [[_cell(cell, row) for cell in row.cells] for row in table.rows]
    widths = [max(3, *(len(line[place]) for line in [headings, *lines])) for place in range(len(headings))]

    def line(cells: list[str]) -> str:
        set_cells = (
            cell.rjust(width) if column.number else cell.ljust(width)
            for cell, width, column in zip(cells, widths, table.columns, strict=True)
        )
        return f"| {' | '.join(set_cells)} |"

    rule = [
        "-" * (width - 1) + ":" if column.number else "-" * width
        for width, column in zip(widths, table.columns, strict=True)
    ]
    notes = [f"\n{escaped(note)}" for note in table.notes]
    return "\n".join([f"### {escaped(table.title)}\n", line(headings), line(rule), *map(line, lines), *notes])


def _cell(cell: TableCell, row: Row) -> str:
    text = escaped(cell.text)
    return f"**{text}**" if row.total and text else text
