"""Prints sheets and results on stdout in the form that was asked for."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from vsnbench.report.build import Report
    from vsnbench.report.compare import Comparison
    from vsnbench.report.contest import Contest
    from vsnbench.report.figures.style import Drawing
    from vsnbench.report.further_answers import Asked
    from vsnbench.report.record import Record
    from vsnbench.report.sheets import Sheet
    from vsnbench.report.summary import ConditionSummary, Results


def print_report(form: str, report: "Report", *, long: bool = False) -> None:
    """Print a report; as JSON and CSV the paper's models follow the measured ones when they were asked for."""
    from dataclasses import replace

    from vsnbench.report.published import published_results

    results = report.results
    if report.reference:
        results = replace(results, conditions=(*results.conditions, *published_results().conditions))
    if form == "json":
        from vsnbench.report.forms.whole_json import to_json

        typer.echo(to_json(results, report.questions, report.activity, report.record), nl=False)
        return
    print_sheets_as(form, report.sheets(long=long), results)


def print_sheets_as(form: str, sheets: "list[Sheet]", results: "Results") -> None:
    """Print sheets as `table`, `markdown` or `latex`, or the results behind them as `json` or `csv`."""
    if form == "table":
        from vsnbench.cli.episode_page import page
        from vsnbench.report.forms.terminal import print_sheets

        print_sheets(sheets, page())
        return
    typer.echo(_text(form, sheets, results), nl=False)


def print_comparisons(
    form: str,
    comparisons: "Sequence[Comparison]",
    contest: "Contest | None",
    asked: "Asked",
    summaries: "Sequence[ConditionSummary]",
    record: "Record",
) -> None:
    """Print comparisons as sheets, or as one JSON object, which holds all that is known of the models as well."""
    import json

    from vsnbench.report.further_answers import answer_fields, answer_sheets

    if form == "json":
        from vsnbench.report.forms.scrutiny_json import twin_fields
        from vsnbench.report.forms.whole_json import model_fields
        from vsnbench.report.summary import Results
        from vsnbench.report.twins import twins

        content = answer_fields(comparisons, contest, asked)
        content["models"] = [model_fields(one, None, record) for one in summaries]
        content["twins"] = [twin_fields(one) for one in twins(Results(tuple(summaries)))]
        typer.echo(json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False))
        return
    sheets = answer_sheets(comparisons, contest, asked)
    if form == "table":
        from vsnbench.cli.episode_page import page
        from vsnbench.report.forms.terminal import print_sheets

        print_sheets(sheets, page())
        return
    from vsnbench.report.forms.latex import latex
    from vsnbench.report.forms.markdown import markdown

    typer.echo(markdown(sheets) if form == "markdown" else latex(sheets), nl=False)


def write_or_serve(report: "Report", drawn: "Sequence[Drawing]", output: Path | None, port: int | None) -> None:
    """Write the whole report into a directory, serve its page, or both."""
    from vsnbench.report.forms.html import html_page
    from vsnbench.report.output import serve_page, write_report

    if output is not None:
        for path in write_report(report, drawn, output):
            typer.echo(str(path))
    if port is not None:
        page = html_page(report, report.sheets(long=True), drawn)
        try:
            serve_page(page, port, lambda address: typer.echo(f"{address}  (Ctrl-C to stop)"))
        except KeyboardInterrupt:
            typer.echo("stopped", err=True)


def _text(form: str, sheets: "list[Sheet]", results: "Results") -> str:
    from vsnbench.report.forms.latex import latex
    from vsnbench.report.forms.markdown import markdown
    from vsnbench.report.forms.plain import to_csv
    from vsnbench.report.forms.whole_json import to_json

    if form == "json":
        return to_json(results)
    if form == "csv":
        return to_csv(results)
    return markdown(sheets) if form == "markdown" else latex(sheets)
