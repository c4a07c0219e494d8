"""`vsnbench report`: success rates with intervals, from the database."""

import logging
import math
import re
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support.lists import split_list, split_numbers
from vsnbench.cli.support.options import Campaigns, Database, Goals, Models, Results, Robots, Sites, results_directory
from vsnbench.cli.support.output import Json, print_files, print_json
from vsnbench.cli.support.terminal import page
from vsnbench.errors import UsageError

if TYPE_CHECKING:
    from vsnbench.report.analysis.conditions import Selection
    from vsnbench.report.build import Report
    from vsnbench.report.figures.style import Drawing
    from vsnbench.report.table import ReportTable
    from vsnbench.results.files.directory import ResultsDirectory

logger = logging.getLogger(__name__)
_FILES = (".html", ".md", ".csv", ".json", ".tex", ".pdf", ".svg", ".png")


class Format(StrEnum):
    """Output formats on stdout."""

    TABLE = "table"
    MARKDOWN = "markdown"
    LATEX = "latex"
    CSV = "csv"
    JSON = "json"


class Reference(StrEnum):
    """Published results."""

    PAPER = "paper"


def command(  # noqa: PLR0913 - Typer needs a parameter per option
    model: Models = None,
    goal: Goals = None,
    site: Sites = None,
    robot: Robots = None,
    campaign: Campaigns = None,
    form: Annotated[Format, typer.Option("--format", "-f", help="Output format on stdout.")] = Format.TABLE,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Directory for report.html, tables and figures."),
    ] = None,
    serve: Annotated[bool, typer.Option("--serve", help="Serve the page on 127.0.0.1 until Ctrl-C.")] = False,
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port of --serve; 0 for any free port.")] = 0,
    website: Annotated[
        Path | None,
        typer.Option("--website", metavar="DIR", help="Directory for a website: all episodes, report, images, videos."),
    ] = None,
    single_file: Annotated[
        Path | None,
        typer.Option("--single-file", metavar="FILE.html", help="File for the same page of up to 100 episodes."),
    ] = None,
    without_videos: Annotated[
        bool, typer.Option("--without-videos", help="Leave the videos out of --website.")
    ] = False,
    reference: Annotated[
        Reference | None, typer.Option("--reference", help="Add published results to the tables.")
    ] = None,
    only_reference: Annotated[
        bool, typer.Option("--only-reference", help="Print only the paper's Tables 3 to 6.")
    ] = False,
    table: Annotated[
        list[str] | None, typer.Option("--table", metavar="A,B", help="Only these tables, by their names in --output.")
    ] = None,
    figure: Annotated[
        list[str] | None,
        typer.Option("--figure", metavar="A,B", help="Only these figures of --output, by their names."),
    ] = None,
    column: Annotated[
        str | None,
        typer.Option(
            "--column", metavar="WIDTH", help="Width of a paper's column, like 8.8cm, for LaTeX tables and figures."
        ),
    ] = None,
    as_checklist: Annotated[
        bool,
        typer.Option("--checklist", help="Print what reviewers ask for, from the record, as Markdown or LaTeX."),
    ] = False,
    all_tables: Annotated[bool, typer.Option("--all-tables", help="Print every table that --output writes.")] = False,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Report success rates with 95 % intervals, actions, SPL and coverage.

    [bold]Examples[/bold]

        vsnbench report                              by goal and in total
        vsnbench report --model vlv --goal chair     one model, one goal
        vsnbench report --format markdown > table.md
        vsnbench report --format json                all results for a script
        vsnbench report --reference paper            with the paper's results
        vsnbench report --all-tables                 seeds, failures, starts ...
        vsnbench report --output report/             page, tables, figures
        vsnbench report --table goals-1 -f latex     one table for a paper
        vsnbench report -o paper/ --column 8.8cm     for that column's width
        vsnbench report --serve                      the page in a browser
        vsnbench report --website site/              all pages as files
        vsnbench report --single-file results.html   one file to send
        vsnbench report --only-reference             the paper's own tables
        vsnbench report --checklist -f latex         what reviewers ask for

    Void attempts (failed motion, lost sensor, model error, aborted,
    interrupted) are counted separately and are not part of the rates.
    """
    from vsnbench.report.analysis.conditions import Selection
    from vsnbench.report.build import build
    from vsnbench.report.output import named

    form = Format.JSON if as_json else form
    column_in = _column_in(column)
    if column_in is not None and output is None and form is not Format.LATEX:
        raise UsageError(
            f"--column {column}: only LaTeX tables and figures are set for a column",
            advice="add --output DIR or --format latex",
            code="bad-column",
        )
    if website and single_file:
        raise UsageError("--website and --single-file: one of them at a time", code="unused-option")
    shows_all = "--only-reference" if only_reference else "the page" if serve else ""
    if website or single_file:
        shows_all = "the website" if website else "the single file"
    if not shows_all and not output and form in (Format.JSON, Format.CSV):
        shows_all = f"--format {form.value}"
    if as_checklist and (shows_all or output or table or all_tables or reference):
        raise UsageError(
            f"--checklist: {shows_all or 'another option of the report'} goes with the tables",
            advice="give --checklist alone, or with --format latex",
            code="unused-option",
        )
    if table and not output and shows_all:
        raise UsageError(f"--table: {shows_all} has all tables", advice="leave it out", code="unused-option")
    if figure and (website or single_file or only_reference or not (output or serve)):
        raise UsageError("--figure: no figures are written one by one", advice="add --output DIR", code="unused-option")
    if output is not None and output.suffix in _FILES and not output.is_dir():
        raise UsageError(
            f"--output {output} must be a directory, which gets report{output.suffix} and other files",
            advice=f"--output {output.with_suffix('')}/",
        )
    if only_reference:
        _print_reference(form)
        return
    selection = Selection(
        models=split_list(model),
        goals=split_list(goal),
        sites=split_list(site),
        robots=split_list(robot),
        campaigns=split_numbers(campaign, "--campaign", "1,3-5"),
    )
    place = results_directory(results, db)
    if as_checklist:
        from vsnbench.report.checklist import checklist

        text = checklist(place.database_url, selection, place.path, as_latex=form is Format.LATEX)
        typer.echo(text, nl=False)
        return
    if website is not None or single_file is not None:
        _write_website(place, selection, website, single_file, with_videos=not without_videos, as_json=as_json)
        return
    with_paper = reference is not None
    if output is not None or serve:
        from vsnbench.report.figures.choose import build_and_draw
        from vsnbench.report.figures.style import FORMATS, PAGE_FORMATS, column_of

        chosen, formats = split_list(figure), PAGE_FORMATS if output is None else FORMATS
        with column_of(column_in):
            report, drawn = build_and_draw(
                place.database_url, selection, place.path, reference=with_paper, only=chosen, formats=formats
            )
        drawn = named(drawn, chosen, "--figure")
        if output is not None:
            _write(report, drawn, output, split_list(table), column_in, as_json=as_json)
        if serve:
            _serve(report, drawn, port)
    else:
        # Activity takes seconds to read: JSON has all results, a table on the terminal must appear at once.
        activity = all_tables or table is not None or form is Format.JSON
        report = build(place.database_url, selection, place.path, reference=with_paper, activity=activity)
        if table is not None and form not in (Format.JSON, Format.CSV):
            print_tables_as(form, named(report.tables(long=True), split_list(table), "--table"), column_in)
        else:
            _print_report(form, report, column_in, long=all_tables)


_INCHES = {"cm": 1 / 2.54, "mm": 1 / 25.4, "in": 1.0, "pt": 1 / 72.27}
"""Inches of a unit of --column; the point is that of LaTeX."""
_NARROWEST_IN, _WIDEST_IN = 2.0, 8.0


def _column_in(text: str | None) -> float | None:
    """Return the width of a column in inches.

    Raises:
        UsageError: it is not a width, or no figure fits (`bad-column`).
    """
    if text is None:
        return None
    match = re.fullmatch(r"(\d{1,4}(?:\.\d{1,4})?) ?(cm|mm|in|pt)", text.strip(), re.ASCII)
    width_in = float(match[1]) * _INCHES[match[2]] if match else math.nan
    if not _NARROWEST_IN <= width_in <= _WIDEST_IN:
        raise UsageError(
            f"--column {text}: must be a width from {_NARROWEST_IN:g} to {_WIDEST_IN:g} inches",
            advice="give it with its unit, like 8.8cm, 88mm, 3.5in or 252pt",
            code="bad-column",
        )
    return width_in


def _write_website(
    place: "ResultsDirectory",
    selection: "Selection",
    directory: Path | None,
    file: Path | None,
    *,
    with_videos: bool,
    as_json: bool,
) -> None:
    """Write a website into a directory, or as a single file."""
    from vsnbench.cli.support.progress import ProgressBars
    from vsnbench.web.results_browser.single_file import write_single_file
    from vsnbench.web.results_browser.website import WEBSITE, write_website

    with ProgressBars() as progress:
        if directory is not None:
            written = write_website(place, selection, directory, with_videos=with_videos, progress=progress.show)
        elif file is not None:
            written = write_single_file(place, selection, file, progress=progress.show)
    for problem in written.problems:
        logger.warning("%s: no video", problem)
    if as_json:
        print_json(WEBSITE.fields(asdict(written) | {"path": str(written.path)}))
        return
    typer.echo(str(written.path))
    images = f"{written.images} images" + (f" (every {written.every}. action)" if written.every > 1 else "")
    size = f"{file.stat().st_size / 1e6:.1f} MB" if file is not None else f"{written.videos} videos"
    sys.stderr.write(f"{written.episodes} episodes, {images}, {size}\n")


def _print_report(form: Format, report: "Report", column_in: float | None, *, long: bool) -> None:
    """Print a report; JSON and CSV have the paper's models after the measured ones if --reference is given."""
    if form not in (Format.JSON, Format.CSV):
        print_tables_as(form, report.tables(long=long), column_in)
        return
    results = report.results
    if report.reference:
        from vsnbench.report.analysis.published import published_results

        results = replace(results, conditions=(*results.conditions, *published_results().conditions))
    if form is Format.JSON:
        from vsnbench.report.formats.json import to_json

        read = (report.questions, report.activity, report.record, report.operator_activity, report.raters)
        typer.echo(to_json(results, *read), nl=False)
    else:
        from vsnbench.report.formats.csv import to_csv

        typer.echo(to_csv(results), nl=False)


def _print_reference(form: Format) -> None:
    """Print the tables of the paper, or the results in them as JSON or CSV."""
    from vsnbench.report.analysis.published import published_results
    from vsnbench.report.formats.csv import to_csv
    from vsnbench.report.formats.json import to_json
    from vsnbench.report.tables.reference import reference_tables

    if form in (Format.JSON, Format.CSV):
        write = to_json if form is Format.JSON else to_csv
        typer.echo(write(published_results()), nl=False)
    else:
        print_tables_as(form, reference_tables())


def print_tables_as(form: str, tables: "Sequence[ReportTable]", column_in: float | None = None) -> None:
    """Print tables as `table`, `markdown` or `latex`, which is set for columns of this width, inches."""
    if form == "table":
        from vsnbench.report.table import print_tables

        print_tables(tables, page())
    elif form == "markdown":
        from vsnbench.report.formats.markdown import markdown

        typer.echo(markdown(tables), nl=False)
    else:
        from vsnbench.report.formats.latex import latex

        typer.echo(latex(tables, column_in), nl=False)


def _write(
    report: "Report",
    drawn: "Sequence[Drawing]",
    output: Path,
    only_tables: "Sequence[str]",
    column_in: float | None,
    *,
    as_json: bool,
) -> None:
    """Write the report into a directory."""
    from vsnbench.report.output import write_report

    print_files(write_report(report, drawn, output, only_tables, column_in), as_json=as_json)
    sys.stderr.write(f"page: {output / 'report.html'} (self-contained)\n")


def _serve(report: "Report", drawn: "Sequence[Drawing]", port: int) -> None:
    """Serve the page of the report until Ctrl-C."""
    from vsnbench.report.formats.html import html_page
    from vsnbench.report.output import serve_page

    page = html_page(report, report.tables(long=True), drawn)
    try:
        serve_page(page, port, lambda address: typer.echo(f"{address}  (Ctrl-C to stop)"))
    except KeyboardInterrupt:
        typer.echo("stopped", err=True)
