"""`vsnbench compare`: is one model better than another, or are there too few trials to say?"""

from collections.abc import Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.options import Database, Results
from vsnbench.cli.output import Json

if TYPE_CHECKING:
    from vsnbench.report.compare import Comparison
    from vsnbench.report.contest import Contest
    from vsnbench.report.further_answers import Asked
    from vsnbench.report.record import Record
    from vsnbench.report.summary import ConditionSummary

_WHAT = "What to compare"


class Format(StrEnum):
    """The forms that go to stdout."""

    TABLE = "table"
    MARKDOWN = "markdown"
    LATEX = "latex"
    JSON = "json"


def command(
    models: Annotated[
        list[str],
        typer.Argument(help="two models or more, as `vsnbench report` names them; paper:vlv and paper:pirlnav too"),
    ],
    by_goal: Annotated[
        bool, typer.Option("--by-goal", help="each shared goal by itself as well", rich_help_panel=_WHAT)
    ] = False,
    goal: Annotated[
        list[str] | None, typer.Option("--goal", "-g", help="only these goal categories", rich_help_panel=_WHAT)
    ] = None,
    site: Annotated[list[str] | None, typer.Option("--site", help="only these sites", rich_help_panel=_WHAT)] = None,
    robot: Annotated[list[str] | None, typer.Option("--robot", help="only these robots", rich_help_panel=_WHAT)] = None,
    campaign: Annotated[
        list[int] | None, typer.Option("--campaign", help="only these campaigns, by number", rich_help_panel=_WHAT)
    ] = None,
    all_tests: Annotated[
        bool, typer.Option("--all-tests", help="show the tests that are not read as well", rich_help_panel=_WHAT)
    ] = False,
    margin: Annotated[
        float | None,
        typer.Option(
            "--margin", min=0.1, max=99, help="are they equivalent within so many points?", rich_help_panel=_WHAT
        ),
    ] = None,
    posterior: Annotated[
        bool, typer.Option("--posterior", help="the probability of being the better as well", rich_help_panel=_WHAT)
    ] = False,
    form: Annotated[Format, typer.Option("--format", "-f", help="what to print on stdout")] = Format.TABLE,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Compare the success rates of models, pair by pair, and say plainly what can be concluded.

    [bold]Examples[/bold]

        vsnbench compare vlv pirlnav                 on the goals they share
        vsnbench compare vlv pirlnav --by-goal       each shared goal too
        vsnbench compare vlv paper:vlv               beside the published ones
        vsnbench compare vlv pirlnav forward         one test over all, then pairs
        vsnbench compare vlv pirlnav --margin 10     the same within 10 points?
        vsnbench compare "vlv real" "vlv simulated"  one model, two conditions

    One question, one p-value. Cells (goal, starting position) of one site
    are paired and the signs of whole starting positions flipped: exact
    McNemar where each was tried once. Independent samples: whole starting
    positions exchanged, or Fisher. Intervals: Newcombe for rates, paired
    where the test is; bootstrap of starting positions for actions and SPL.
    Seeds and repetitions are no new places. Several questions are corrected
    after Holm. Below 95 % of the planned trials no winner is named.
    """
    from vsnbench.record.results import ResultsDirectory
    from vsnbench.report.build import read
    from vsnbench.report.compare import compare, find_condition
    from vsnbench.report.contest import contest_of
    from vsnbench.report.further_answers import Asked
    from vsnbench.report.published import published_results
    from vsnbench.report.record import Selection
    from vsnbench.report.summary import summarise

    published = published_results()
    if all(name.startswith("paper:") for name in models):
        from vsnbench.report.record import empty_record

        record = empty_record()
    else:
        place = ResultsDirectory.locate(results, db)
        selection = Selection(
            goals=tuple(goal or ()),
            sites=tuple(site or ()),
            robots=tuple(robot or ()),
            campaigns=tuple(campaign or ()),
        )
        record = read(place.database_url, selection, place.path)
    summarised = summarise(record)
    found = compare(record, summarised, models, by_goal=by_goal, published=published)
    summaries = [find_condition(name, summarised, published) for name in models]
    asked = Asked(all_tests, margin / 100 if margin else None, posterior)
    form = Format.JSON if as_json else form
    _print_comparisons(form.value, found, contest_of(summaries, found), asked, summaries, record)


def _print_comparisons(
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
        from vsnbench.report.sheets import print_sheets

        print_sheets(sheets, page())
        return
    from vsnbench.report.forms.latex import latex
    from vsnbench.report.forms.markdown import markdown

    typer.echo(markdown(sheets) if form == "markdown" else latex(sheets), nl=False)
