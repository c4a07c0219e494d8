"""`vsnbench report`: success rates with intervals, from the database alone."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

_WHAT = "What to report on"
_FORM = "Form"
_RECORD = "Record"


class Format(StrEnum):
    """The forms that go to stdout."""

    TABLE = "table"
    MARKDOWN = "markdown"
    CSV = "csv"
    JSON = "json"


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
    results: Annotated[
        Path | None,
        typer.Option(
            "--results",
            help="results directory; $VSNBENCH_RESULTS, then ./results, when absent",
            rich_help_panel=_RECORD,
        ),
    ] = None,
    db: Annotated[
        str | None,
        typer.Option("--db", help="SQLAlchemy URL in place of the directory's SQLite", rich_help_panel=_RECORD),
    ] = None,
) -> None:
    """Report success rates with 95 % intervals, actions, SPL and coverage.

    [bold]Examples[/bold]

        vsnbench report                                  every model, by goal and in total
        vsnbench report --model vlv --goal chair         one model, one goal
        vsnbench report --format markdown > table.md     to paste into a page
        vsnbench report --format json                    for a script; rates are shares of 0 to 1

    Void attempts (failed motion, lost sensor, model error, aborted, interrupted) are counted beside and never inside.
    """
    from vsnbench.report.build import read, tables
    from vsnbench.report.forms.markdown import markdown
    from vsnbench.report.forms.plain import to_csv, to_json
    from vsnbench.report.record import Selection
    from vsnbench.report.summary import summarise
    from vsnbench.runner.results import ResultsDirectory

    selection = Selection(
        models=tuple(model or ()),
        goals=tuple(goal or ()),
        sites=tuple(site or ()),
        robots=tuple(robot or ()),
        campaigns=tuple(campaign or ()),
    )
    place = ResultsDirectory.locate(results, db)
    outcome = summarise(read(place.database_url, selection, place.path))
    match form:
        case Format.JSON:
            typer.echo(to_json(outcome), nl=False)
        case Format.CSV:
            typer.echo(to_csv(outcome), nl=False)
        case Format.MARKDOWN:
            typer.echo(markdown(tables(outcome)), nl=False)
        case Format.TABLE:
            from vsnbench.cli.episode_page import page
            from vsnbench.report.forms.terminal import print_sheets

            print_sheets(tables(outcome), page())
