"""`vsnbench report`: success rates with intervals, from the database alone."""

import sys
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.options import Database, Results
from vsnbench.cli.output import Json, print_files
from vsnbench.errors import UsageError

if TYPE_CHECKING:
    from vsnbench.report.build import Report
    from vsnbench.report.figures.style import Drawing
    from vsnbench.report.sheets import Sheet
    from vsnbench.report.summary import Results as Numbers

_WHAT = "What to report on"
_FORM = "Form"
_FILES = (".html", ".md", ".csv", ".json", ".tex", ".pdf", ".svg", ".png")


class Format(StrEnum):
    """The forms that go to stdout."""

    TABLE = "table"
    MARKDOWN = "markdown"
    LATEX = "latex"
    CSV = "csv"
    JSON = "json"


class Reference(StrEnum):
    """The published numbers that there are."""

    PAPER = "paper"


def command(
    model: Annotated[
        list[str] | None, typer.Option("--model", "-m", help="only these models", rich_help_panel=_WHAT)
    ] = None,
    goal: Annotated[
        list[str] | None, typer.Option("--goal", "-g", help="only these goal categories", rich_help_panel=_WHAT)
    ] = None,
    site: Annotated[list[str] | None, typer.Option("--site", help="only these sites", rich_help_panel=_WHAT)] = None,
    robot: Annotated[list[str] | None, typer.Option("--robot", help="only these robots", rich_help_panel=_WHAT)] = None,
    campaign: Annotated[
        list[int] | None, typer.Option("--campaign", help="only these campaigns, by number", rich_help_panel=_WHAT)
    ] = None,
    form: Annotated[
        Format, typer.Option("--format", "-f", help="what to print on stdout", rich_help_panel=_FORM)
    ] = Format.TABLE,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="write report.html and all else into it", rich_help_panel=_FORM
        ),
    ] = None,
    serve: Annotated[
        bool, typer.Option("--serve", help="show the page on 127.0.0.1 until Ctrl-C", rich_help_panel=_FORM)
    ] = False,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="for --serve; 0 for any", rich_help_panel=_FORM)
    ] = 0,
    reference: Annotated[
        Reference | None, typer.Option("--reference", help="lay published numbers beside", rich_help_panel=_WHAT)
    ] = None,
    all_tables: Annotated[
        bool,
        typer.Option(
            "--all-tables", help="every table that the record supports, as --output has", rich_help_panel=_FORM
        ),
    ] = False,
    only_reference: Annotated[
        bool, typer.Option("--only-reference", help="only the paper's Tables 3 to 6", rich_help_panel=_WHAT)
    ] = False,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Report success rates with 95 % intervals, actions, SPL and coverage.

    [bold]Examples[/bold]

        vsnbench report                              by goal and in total
        vsnbench report --model vlv --goal chair     one model, one goal
        vsnbench report --format markdown > table.md
        vsnbench report --format json                all of it, for a script
        vsnbench report --reference paper            the paper's numbers beside
        vsnbench report --all-tables                 seeds, failures, starts ...
        vsnbench report --output report/             page, tables, figures
        vsnbench report --serve                      the page in your browser
        vsnbench report --only-reference             the paper's own tables

    Void attempts (failed motion, lost sensor, model error, aborted,
    interrupted) are counted beside and never inside.
    """
    from vsnbench.record.results import ResultsDirectory
    from vsnbench.report.build import build
    from vsnbench.report.record import Selection

    form = Format.JSON if as_json else form
    if output is not None and output.suffix in _FILES and not output.is_dir():
        raise UsageError(
            f"--output {output} is a directory's place: it gets report{output.suffix} and all else",
            advice=f"--output {output.with_suffix('')}/",
        )
    if only_reference:
        from vsnbench.report.published import published_results
        from vsnbench.report.reference_tables import reference_sheets

        _print_sheets_as(form.value, reference_sheets(), published_results())
        return
    selection = Selection(
        models=tuple(model or ()),
        goals=tuple(goal or ()),
        sites=tuple(site or ()),
        robots=tuple(robot or ()),
        campaigns=tuple(campaign or ()),
    )
    place = ResultsDirectory.locate(results, db)
    with_paper = reference is not None
    if output is not None or serve:
        from vsnbench.report.drawings import build_and_draw

        report, drawn = build_and_draw(place.database_url, selection, place.path, reference=with_paper)
        _write_or_serve(report, drawn, output, port if serve else None, as_json=as_json)
    else:
        # JSON is for programs, which have no other way to ask; a person's table is to come at once.
        whole = all_tables or form is Format.JSON
        report = build(place.database_url, selection, place.path, reference=with_paper, activity=whole)
        _print_report(form.value, report, long=all_tables)


def _print_report(form: str, report: "Report", *, long: bool = False) -> None:
    """Print a report; as JSON and CSV the paper's models follow the measured ones when they were asked for."""
    from dataclasses import replace

    from vsnbench.report.published import published_results

    results = report.results
    if report.reference:
        results = replace(results, conditions=(*results.conditions, *published_results().conditions))
    if form == "json":
        from vsnbench.report.forms.whole_json import to_json

        typer.echo(to_json(results, report.questions, report.activity, report.record, report.attended), nl=False)
        return
    _print_sheets_as(form, report.sheets(long=long), results)


def _print_sheets_as(form: str, sheets: "list[Sheet]", results: "Numbers") -> None:
    """Print sheets as `table`, `markdown` or `latex`, or the results behind them as `json` or `csv`."""
    if form == "table":
        from vsnbench.cli.episode_page import page
        from vsnbench.report.sheets import print_sheets

        print_sheets(sheets, page())
        return
    typer.echo(_text(form, sheets, results), nl=False)


def _text(form: str, sheets: "list[Sheet]", results: "Numbers") -> str:
    from vsnbench.report.forms.latex import latex
    from vsnbench.report.forms.markdown import markdown
    from vsnbench.report.forms.plain import to_csv
    from vsnbench.report.forms.whole_json import to_json

    if form == "json":
        return to_json(results)
    if form == "csv":
        return to_csv(results)
    return markdown(sheets) if form == "markdown" else latex(sheets)


def _write_or_serve(
    report: "Report", drawn: "Sequence[Drawing]", output: Path | None, port: int | None, *, as_json: bool
) -> None:
    """Write the whole report into a directory, serve its page, or both."""
    from vsnbench.report.forms.html import html_page
    from vsnbench.report.output import serve_page, write_report

    if output is not None:
        print_files(write_report(report, drawn, output), as_json=as_json)
        sys.stderr.write(f"the page: {output / 'report.html'}, which stands alone\n")
    if port is not None:
        page = html_page(report, report.sheets(long=True), drawn)
        try:
            serve_page(page, port, lambda address: typer.echo(f"{address}  (Ctrl-C to stop)"))
        except KeyboardInterrupt:
            typer.echo("stopped", err=True)
