"""`vsnbench compare`: tests of the differences between models."""

import json
import logging
from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.results.report import print_tables_as
from vsnbench.cli.support.lists import split_list, split_numbers
from vsnbench.cli.support.options import Campaigns, Database, Goals, Results, Robots, Sites, results_directory
from vsnbench.cli.support.output import Json

if TYPE_CHECKING:
    from vsnbench.report.analysis.episodes_frame import ReportData
    from vsnbench.report.analysis.summary import ConditionSummary
    from vsnbench.report.comparison.compare import Comparison
    from vsnbench.report.comparison.ranking import Ranking
    from vsnbench.results.files.directory import ResultsDirectory


logger = logging.getLogger(__name__)


class CompareFormat(StrEnum):
    """Output formats on stdout."""

    TABLE = "table"
    MARKDOWN = "markdown"
    LATEX = "latex"
    JSON = "json"


def command(  # noqa: PLR0913 - Typer needs a parameter per option
    models: Annotated[
        list[str],
        typer.Argument(
            metavar="MODEL...", help="Two or more models, named as in `vsnbench report`, or paper:vlv, paper:pirlnav."
        ),
    ],
    by_goal: Annotated[bool, typer.Option("--by-goal", help="Compare for each shared goal as well.")] = False,
    goal: Goals = None,
    site: Sites = None,
    robot: Robots = None,
    campaign: Campaigns = None,
    form: Annotated[
        CompareFormat, typer.Option("--format", "-f", help="Output format on stdout.")
    ] = CompareFormat.TABLE,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Compare the success rates of models, pair by pair.

    [bold]Examples[/bold]

        vsnbench compare vlv pirlnav                 on the goals they share
        vsnbench compare vlv pirlnav --by-goal       each shared goal as well
        vsnbench compare vlv paper:vlv               with published results
        vsnbench compare vlv pirlnav forward         one test over all, then pairs
        vsnbench compare "vlv real" "vlv simulated"  one model, two conditions

    Each question has one p-value. Cells (goal, starting position) of the
    same site are paired, and the signs of whole starting positions are
    flipped; exact McNemar if each cell was tried once. Independent samples:
    permutation of whole starting positions, or Fisher's exact test.
    Intervals: Newcombe for rates, paired if the test is; bootstrap of
    starting positions for actions, progress, SPL and courses. Several questions are corrected
    after Holm. Seeds and repetitions do not count as new positions. Below
    95 % of the planned trials no winner is named. Comparisons with new
    results are counted in looks.jsonl of the results directory.
    """
    from vsnbench.report.analysis.conditions import Selection
    from vsnbench.report.analysis.published import published_results
    from vsnbench.report.analysis.summary import summarise
    from vsnbench.report.build import read
    from vsnbench.report.comparison.compare import compare, find_condition
    from vsnbench.report.comparison.looks import with_looks
    from vsnbench.report.comparison.ranking import ranking_of

    published, place = published_results(), None
    if all(name.startswith("paper:") for name in models):
        from vsnbench.report.analysis.episodes_frame import empty_report_data

        record = empty_report_data()
    else:
        place = results_directory(results, db)
        selection = Selection(
            goals=split_list(goal),
            sites=split_list(site),
            robots=split_list(robot),
            campaigns=split_numbers(campaign, "--campaign", "1,3-5"),
        )
        record = read(place.database_url, selection, place.path)
    summarised = summarise(record)
    summaries = [find_condition(name, summarised, published) for name in models]
    if place is not None:
        record = _with_courses(record, summaries, place)
    found = compare(record, summarised, models, by_goal=by_goal, published=published)
    if place is not None:
        found, problem = with_looks(found, place.path)
        if problem:
            logger.warning("%s", problem)
    form = CompareFormat.JSON if as_json else form
    _print_comparisons(form, found, ranking_of(summaries, found), summaries, record)


def _with_courses(
    record: "ReportData", chosen: "Sequence[ConditionSummary]", place: "ResultsDirectory"
) -> "ReportData":
    """Return the record with the courses of the chosen conditions measured."""
    from vsnbench.cli.support.progress import ProgressBars
    from vsnbench.report.analysis.courses import measure_courses
    from vsnbench.results.schema.migrate import open_record

    conditions = tuple(summary.condition for summary in chosen if not summary.condition.published)
    with ProgressBars() as progress, open_record(place.database_url) as engine:
        measured, _ = measure_courses(
            engine,
            replace(record, conditions=conditions),
            lambda done, of: progress.show("measuring courses", done, of),
        )
    return replace(record, courses=measured)


def _print_comparisons(
    form: CompareFormat,
    comparisons: "Sequence[Comparison]",
    ranking: "Ranking | None",
    summaries: "Sequence[ConditionSummary]",
    record: "ReportData",
) -> None:
    """Print comparisons as tables, or with the results of the models as one JSON object."""
    from vsnbench.report.tables.comparison import comparison_tables
    from vsnbench.report.tables.ranking import ranking_table

    if form is CompareFormat.JSON:
        from vsnbench.report.formats.json import COMPARED

        found = {"ranking": ranking, "comparisons": comparisons, "summaries": summaries, "record": record}
        typer.echo(json.dumps(COMPARED.fields(found), indent=2, ensure_ascii=False, allow_nan=False))
        return
    tables = [ranking_table(ranking)] if ranking else []
    print_tables_as(form, [*tables, *(table for comparison in comparisons for table in comparison_tables(comparison))])
