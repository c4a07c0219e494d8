"""Sheets as LaTeX tables for a two-column paper: booktabs, type that fits, captions that say n and interval."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from vsnbench.harmless_text import harmless
from vsnbench.report.sheets import Column, Sheet, fitted, footnotes_of

PREAMBLE = r"""% \usepackage[T1]{fontenc}
% \usepackage{array}
% \usepackage{booktabs}"""
"""What a paper needs to load, as comments: the tables are meant to be pasted."""


@dataclass(frozen=True, slots=True)
class _Size:
    """A size of type and the width of a letter in it, as digits and bold headings come out on average."""

    command: str
    letter_pt: float


_SIZES = (_Size(r"\small", 4.7), _Size(r"\footnotesize", 4.2), _Size(r"\scriptsize", 3.7))
_COLUMN_PT, _PAGE_PT = 243.0, 498.0
"""Of a two-column paper on A4 or letter, with margins of 2 cm and more."""
_GAP_PT = 6.0
_WRAPPED_LETTERS = 22
"""A name that is longer is set in lines."""
_FLOATS_AT_ONCE = 12
"""LaTeX keeps so many waiting without complaint."""

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


def latex(sheets: Iterable[Sheet]) -> str:
    """Return one float a sheet, `table` where it fits a column of a two-column paper, else `table*`."""
    sheets = list(sheets)
    names = "".join(f"% {escaped(words)}\n" for words in footnotes_of(sheets))
    return f"{PREAMBLE}\n{names}\n" + "\n\n".join(_float(sheet) for sheet in sheets) + "\n"


def document(sheets: Iterable[Sheet], figures: Iterable[tuple[str, bool, str]] = ()) -> str:
    """Return a two-column document of its own that compiles with pdflatex.

    Args:
        sheets: the tables.
        figures: file, whether it is wider than a column, and caption of each.
    """
    sheets = list(sheets)
    names = [rf"\item {escaped(words)}" for words in footnotes_of(sheets)]
    said = [r"\section*{What the names stand for}", r"\begin{itemize}", *names, r"\end{itemize}"] if names else []
    floats = [*(_figure(*figure) for figure in figures), *(_float(sheet) for sheet in sheets)]
    parts = [
        "\n".join([*floats[at : at + _FLOATS_AT_ONCE], r"\clearpage"]) for at in range(0, len(floats), _FLOATS_AT_ONCE)
    ]
    return "\n".join([_OPENING, *said, *parts, r"\end{document}", ""])


def escaped(text: str) -> str:
    """Return text that LaTeX sets as it is; a letter that pdflatex has no font for is written by its number."""
    words = "".join(_mark(mark) for mark in harmless(text))
    words = words.replace("--", "-{}-").replace("''", "'{}'").replace("?`", "?{}`").replace("!`", "!{}`")
    # At the start of a line these would be taken for arguments of the line break before.
    return f"{{{words[0]}}}{words[1:]}" if words[:1] in ("[", "*") else words


def breakable(text: str) -> str:
    """Return text that LaTeX may break after the marks within a name, where it would see one long word."""
    return r"\allowbreak{}".join(escaped(part) for part in re.findall(r"[^.:/=_]+[.:/=_]*|[.:/=_]+", text))


def _mark(mark: str) -> str:
    if mark in _ESCAPES:
        return _ESCAPES[mark]
    if mark.isascii() or "\N{LATIN CAPITAL LETTER A WITH GRAVE}" <= mark <= "\N{LATIN SMALL LETTER Y WITH DIAERESIS}":
        return mark
    return f"U+{ord(mark):04X}"


def _float(sheet: Sheet) -> str:
    size = next((size for size in _SIZES if _width_pt(sheet, size) <= _COLUMN_PT), None)
    wide = size is None
    if size is None:
        size = next((size for size in _SIZES if _width_pt(sheet, size) <= _PAGE_PT), _SIZES[-1])
        sheet = fitted(sheet, lambda part: _width_pt(part, size) <= _PAGE_PT)
    environment = "table*" if wide else "table"
    columns = "".join(_alignment(sheet, place) for place in range(len(sheet.columns)))
    lines = [
        rf"\begin{{{environment}}}[tbp]",
        r"\centering",
        rf"\caption{{{_caption(sheet)}}}",
        rf"\label{{tab:{_label(sheet.name)}}}",
        rf"{size.command}\setlength{{\tabcolsep}}{{{_GAP_PT / 2:g}pt}}",
        rf"\begin{{tabular}}{{@{{}}{columns}@{{}}}}",
        r"\toprule",
        " & ".join(_heading(column) for column in sheet.columns) + r" \\",
        r"\midrule",
    ]
    for index, row in enumerate(sheet.rows):
        if row.total and index and not sheet.rows[index - 1].total:
            lines.append(r"\midrule")
        cells = [
            breakable(cell.text) if _is_wrapped(sheet, place) else escaped(cell.text)
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


def _alignment(sheet: Sheet, place: int) -> str:
    if sheet.columns[place].number:
        return "r"
    if _is_wrapped(sheet, place):
        return rf">{{\raggedright\arraybackslash}}p{{{_WRAPPED_LETTERS / 2:g}em}}"
    return "l"


def _is_wrapped(sheet: Sheet, place: int) -> bool:
    return not sheet.columns[place].number and _letters(sheet, place) > _WRAPPED_LETTERS


def _letters(sheet: Sheet, place: int) -> int:
    heading = round(1.15 * len(sheet.columns[place].heading))  # it is bold
    return max(heading, *(len(row.cells[place].text) for row in sheet.rows), 0)


def _width_pt(sheet: Sheet, size: _Size) -> float:
    """Estimate the width of a table: names wrap, numbers do not."""
    letters = [
        _letters(sheet, place) if column.number else min(_letters(sheet, place), _WRAPPED_LETTERS)
        for place, column in enumerate(sheet.columns)
    ]
    return size.letter_pt * sum(letters) + _GAP_PT * (len(letters) - 1)


def _heading(column: Column) -> str:
    return rf"\textbf{{{escaped(column.heading)}}}"


def _caption(sheet: Sheet) -> str:
    meanings = [
        f"{escaped(column.heading)}: {escaped(column.note)}"
        for column in sheet.columns
        if column.note and ("/n" in column.heading or "interval" in column.heading)
    ]
    parts = [f"{escaped(sheet.title)}."]
    if meanings:
        parts.append("; ".join(meanings) + ".")
    parts += [escaped(note) for note in sheet.notes]
    return " ".join(parts)


def _label(name: str) -> str:
    return "".join(mark if mark.isalnum() else "-" for mark in name)
