"""Sheets as LaTeX tables for a paper: booktabs, numbers aligned, the caption says what n and the interval are."""

from collections.abc import Iterable

from vsnbench.harmless_text import harmless
from vsnbench.report.sheets import Column, Sheet

PREAMBLE = r"""% \usepackage[T1]{fontenc}
% \usepackage{booktabs}
% \usepackage{graphicx}"""
"""What a paper needs to load, as comments: the tables are meant to be pasted."""

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
    "°": r"\textdegree{}",
}


def latex(sheets: Iterable[Sheet]) -> str:
    """Return one `table` environment a sheet."""
    return PREAMBLE + "\n\n" + "\n\n".join(_table(sheet) for sheet in sheets) + "\n"


def document(sheets: Iterable[Sheet]) -> str:
    """Return a document of its own that compiles with pdflatex."""
    return "\n".join(
        [
            r"\documentclass[a4paper]{article}",
            r"\usepackage[T1]{fontenc}",
            r"\usepackage[utf8]{inputenc}",
            r"\usepackage{textcomp}",
            r"\usepackage{booktabs}",
            r"\usepackage{graphicx}",
            r"\usepackage[margin=2cm]{geometry}",
            r"\begin{document}",
            *(_table(sheet) + "\n" + r"\clearpage" for sheet in sheets),
            r"\end{document}",
            "",
        ]
    )


def escaped(text: str) -> str:
    """Return text that LaTeX sets as it is; a letter that pdflatex has no font for is written by its number."""
    words = "".join(_mark(mark) for mark in harmless(text))
    words = words.replace("--", "-{}-").replace("''", "'{}'").replace("?`", "?{}`").replace("!`", "!{}`")
    # At the start of a line these would be taken for arguments of the line break before.
    return f"{{{words[0]}}}{words[1:]}" if words[:1] in ("[", "*") else words


def _mark(mark: str) -> str:
    if mark in _ESCAPES:
        return _ESCAPES[mark]
    if mark.isascii() or "\N{LATIN CAPITAL LETTER A WITH GRAVE}" <= mark <= "\N{LATIN SMALL LETTER Y WITH DIAERESIS}":
        return mark
    return f"U+{ord(mark):04X}"


def _table(sheet: Sheet) -> str:
    columns = "".join("r" if column.number else "l" for column in sheet.columns)
    # Wide tables shrink to the line; narrow ones keep the size of their text.
    lines = [
        r"\begin{table}[htbp]",
        r"\centering",
        rf"\caption{{{_caption(sheet)}}}",
        rf"\label{{tab:{_label(sheet.name)}}}",
        r"\medskip",
        r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%",
        rf"\begin{{tabular}}{{@{{}}{columns}@{{}}}}",
        r"\toprule",
        " & ".join(_heading(column) for column in sheet.columns) + r" \\",
        r"\midrule",
    ]
    for index, row in enumerate(sheet.rows):
        if row.total and index and not sheet.rows[index - 1].total:
            lines.append(r"\midrule")
        lines.append(" & ".join(escaped(cell.text) for cell in row.cells) + r" \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}}", r"\end{table}"])


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
