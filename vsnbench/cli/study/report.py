"""Prints or writes the report of a study."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from vsnbench.cli.support.terminal import page, safe

if TYPE_CHECKING:
    from vsnbench.report.study.findings import StudyFindings


class StudyFormat(StrEnum):
    """Output formats on stdout."""

    TABLE = "table"
    MARKDOWN = "markdown"
    LATEX = "latex"
    HTML = "html"
    JSON = "json"


def print_findings(form: StudyFormat, found: "StudyFindings") -> None:
    """Print the report in one format."""
    from vsnbench.report.study import forms

    if form is not StudyFormat.TABLE:
        write = {
            StudyFormat.MARKDOWN: forms.to_markdown,
            StudyFormat.LATEX: forms.to_latex,
            StudyFormat.HTML: forms.to_html,
            StudyFormat.JSON: forms.to_json,
        }[form]
        typer.echo(write(found), nl=False)
        return
    from vsnbench.report.study.tables import study_tables
    from vsnbench.report.tables.report_table import print_tables

    console = page()
    console.print(f"[bold]{safe(found.recorded.title)}[/bold]")
    console.print(f"[dim]{safe(found.plan.question)}[/dim]\n")
    console.print(f"[bold]{safe(found.conclusion)}[/bold]\n")
    print_tables(study_tables(found), console)


def write_findings(found: "StudyFindings", directory: Path) -> tuple[Path, ...]:
    """Write the report in every format and return the paths.

    Raises:
        RecordError: the directory cannot be written.
    """
    from vsnbench.files.atomic import write_atomic
    from vsnbench.report.study import forms

    files = {
        "study.html": forms.to_html(found),
        "study.md": forms.to_markdown(found),
        "study.tex": forms.to_latex(found),
        "study.json": forms.to_json(found),
    }
    for name, content in files.items():
        write_atomic(directory / name, content.encode())
    return tuple(directory / name for name in files)
