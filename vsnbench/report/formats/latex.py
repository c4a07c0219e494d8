"""Report tables as LaTeX for a two-column paper: booktabs, fitting font sizes, captions with n and interval."""

import re
from collections.abc import Iterable

from vsnbench.report.table import ReportTable, fitted, footnotes_of
from vsnbench.text.sanitize import sanitize

PREAMBLE = r"""% \usepackage[T1]{fontenc}
% \usepackage{array}
% \usepackage{booktabs}"""
"""Required packages, as comments, because the tables are pasted into another document."""


_LETTER_PT = {r"\small": 4.7, r"\footnotesize": 4.2, r"\scriptsize": 3.7}
"""Font size -> average character width for digits and bold headings."""
_COLUMN_PT, _GUTTER_PT = 243.0, 12.0
"""Width of a column, and space between two, in a two-column paper on A4 or letter with margins of at least 2 cm."""
_POINTS_AN_INCH = 72.27
_GAP_PT = 6.0
_WRAPPED_LETTERS = 22
"""Longer names are wrapped."""
_FLOATS_AT_ONCE = 12
"""Number of floats after which the page is cleared, because LaTeX queues only a few."""

_OPENING = r"""\documentclass[a4paper,twocolumn]{article}
\usepackage[T1]{fontenc}
\usepackage[utf8]{inputenc}
\IfFileExists{lmodern.sty}{\usepackage{lmodern}}{}
\usepackage{textcomp}
\usepackage{array}
\usepackage{booktabs}
\usepackage{graphicx}
\usepackage[margin=1.8cm]{geometry}
\setcounter{totalnumber}{20}\setcounter{topnumber}{20}\setcounter{dbltopnumber}{20}
\renewcommand{\topfraction}{.98}\renewcommand{\dbltopfraction}{.98}\renewcommand{\textfraction}{.02}
\renewcommand{\floatpagefraction}{.6}\renewcommand{\dblfloatpagefraction}{.6}
\begin{document}"""

_ESCAPES = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "`": r"\textasciigrave{}",
    "²": r"\textsuperscript{2}",
    "–": r"\textendash{}",
    "−": r"\textminus{}",
    "…": r"\ldots{}",
    "°": r"\textdegree{}",
}


def latex(tables: Iterable[ReportTable], column_in: float | None = None) -> str:
    """Return one float per table: `table` if it fits a column of a two-column paper, else `table*`.

    Args:
        tables: tables of the report.
        column_in: width of a column, inches; None for the default.
    """
    tables = list(tables)
    names = "".join(f"% {escaped(words)}\n" for words in footnotes_of(tables))
    return f"{PREAMBLE}\n{names}\n" + "\n\n".join(_flushed([_float(table, column_in) for table in tables])) + "\n"


def document(
    tables: Iterable[ReportTable], figures: Iterable[tuple[str, bool, str]] = (), column_in: float | None = None
) -> str:
    """Return a complete two-column document for pdflatex.

    Args:
        tables: tables of the report.
        figures: file, whether it is wider than a column, and caption of each figure.
        column_in: width of a column for which tables are set, inches; None for the default.
    """
    tables = list(tables)
    names = [rf"\item {escaped(words)}" for words in footnotes_of(tables)]
    names_section = (
        [r"\section*{Names of the conditions}", r"\begin{itemize}", *names, r"\end{itemize}"] if names else []
    )
    floats = [*(_figure(*figure) for figure in figures), *(_float(table, column_in) for table in tables)]
    return "\n".join([_OPENING, *names_section, *_flushed(floats), r"\clearpage", r"\end{document}", ""])


def _flushed(floats: list[str]) -> list[str]:
    """Return floats with commands that clear the page before more than LaTeX can queue."""
    parts: list[str] = []
    for place, each in enumerate(floats):
        parts += [r"\clearpage", each] if place and place % _FLOATS_AT_ONCE == 0 else [each]
    return parts


def escaped(text: str) -> str:
    """Escape text for LaTeX; characters without a pdflatex font are written by number."""
    words = "".join(_mark(mark) for mark in sanitize(text))
    words = words.replace("--", "-{}-").replace("''", "'{}'").replace("?`", "?{}`").replace("!`", "!{}`")
    # At the start of a row these would be parsed as arguments of the preceding line break.
    return f"{{{words[0]}}}{words[1:]}" if words[:1] in ("[", "*") else words


def breakable(text: str) -> str:
    """Escape text and allow line breaks after punctuation within names."""
    return r"\allowbreak{}".join(escaped(part) for part in re.findall(r"[^.:/=_]+[.:/=_]*|[.:/=_]+", text))


def _mark(mark: str) -> str:
    if mark in _ESCAPES:
        return _ESCAPES[mark]
    if mark.isascii() or "\N{LATIN CAPITAL LETTER A WITH GRAVE}" <= mark <= "\N{LATIN SMALL LETTER Y WITH DIAERESIS}":
        return mark
    return f"U+{ord(mark):04X}"


def _float(table: ReportTable, column_in: float | None) -> str:
    column_pt = _COLUMN_PT if column_in is None else column_in * _POINTS_AN_INCH
    page_pt = 2 * column_pt + _GUTTER_PT
    size = next((size for size in _LETTER_PT if _width_pt(table, size) <= column_pt), "")
    wide = not size
    if wide:
        size = next((size for size in _LETTER_PT if _width_pt(table, size) <= page_pt), r"\scriptsize")
        table = fitted(table, lambda part: _width_pt(part, size) <= page_pt)
    environment = "table*" if wide else "table"
    columns = "".join(_alignment(table, place) for place in range(len(table.columns)))
    lines = [
        rf"\begin{{{environment}}}[tbp]",
        r"\centering",
        rf"\caption{{{_caption(table)}}}",
        rf"\label{{tab:{label(table.name)}}}",
        rf"{size}\setlength{{\tabcolsep}}{{{_GAP_PT / 2:g}pt}}",
        rf"\begin{{tabular}}{{@{{}}{columns}@{{}}}}",
        r"\toprule",
        " & ".join(rf"\textbf{{{escaped(column.heading)}}}" for column in table.columns) + r" \\",
        r"\midrule",
    ]
    for index, row in enumerate(table.rows):
        if row.total and index and not table.rows[index - 1].total:
            lines.append(r"\midrule")
        cells = [
            breakable(cell.text) if _is_wrapped(table, place) else escaped(cell.text)
            for place, cell in enumerate(row.cells)
        ]
        lines.append(" & ".join(cells) + r" \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", rf"\end{{{environment}}}"])


def _figure(file: str, wide: bool, caption: str) -> str:
    environment = "figure*" if wide else "figure"
    return "\n".join(
        [
            rf"\begin{{{environment}}}[tbp]",
            r"\centering",
            rf"\includegraphics[width=\linewidth,height=.8\textheight,keepaspectratio]{{{file}}}",
            rf"\caption{{{escaped(caption)}}}",
            rf"\end{{{environment}}}",
        ]
    )


def _alignment(table: ReportTable, place: int) -> str:
    if table.columns[place].number:
        return "r"
    if _is_wrapped(table, place):
        return rf">{{\raggedright\arraybackslash}}p{{{_WRAPPED_LETTERS / 2:g}em}}"
    return "l"


def _is_wrapped(table: ReportTable, place: int) -> bool:
    return not table.columns[place].number and _letters(table, place) > _WRAPPED_LETTERS


def _letters(table: ReportTable, place: int) -> int:
    heading = round(1.15 * len(table.columns[place].heading))  # it is bold
    return max(heading, *(len(row.cells[place].text) for row in table.rows), 0)


def _width_pt(table: ReportTable, size: str) -> float:
    """Estimate the width of a table: text columns wrap, numbers do not."""
    letters = [
        _letters(table, place) if column.number else min(_letters(table, place), _WRAPPED_LETTERS)
        for place, column in enumerate(table.columns)
    ]
    return _LETTER_PT[size] * sum(letters) + _GAP_PT * (len(letters) - 1)


def _caption(table: ReportTable) -> str:
    meanings = [
        f"{escaped(column.heading)}: {escaped(column.note)}"
        for column in table.columns
        if column.note and ("/n" in column.heading or "interval" in column.heading)
    ]
    parts = [f"{escaped(table.title)}."]
    if meanings:
        parts.append("; ".join(meanings) + ".")
    parts += [escaped(note) for note in table.notes]
    return " ".join(parts)


def label(name: str) -> str:
    """Return the name of a table for a label or a file."""
    return "".join(mark if mark.isalnum() else "-" for mark in name)
