"""`vsnbench episodes`: list and show recorded episodes."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support.listing import name_column, print_list, prose_column
from vsnbench.cli.support.lists import split_list
from vsnbench.cli.support.options import Database, Goals, Models, Results, open_results
from vsnbench.cli.support.output import Json, print_json
from vsnbench.cli.support.terminal import COLORS, page, safe
from vsnbench.errors import UsageError
from vsnbench.report.table import Column

if TYPE_CHECKING:
    from sqlalchemy import Engine

    from vsnbench.report.analysis.courses import CourseMeasures
    from vsnbench.results.model import EpisodeRecord
    from vsnbench.results.reading.filtering import EpisodeFilter
    from vsnbench.values.step import StepRecord

app = typer.Typer(no_args_is_help=True)

_TABLE_ROWS = 50


@app.command("list")
def list_(  # noqa: PLR0913 - Typer needs a parameter per option
    model: Models = None,
    goal: Goals = None,
    campaign: Annotated[
        str,
        typer.Option("--campaign", help="Only this campaign: its number, name, or at least 8 digits of its key."),
    ] = "",
    outcome: Annotated[
        str,
        typer.Option(
            "--outcome",
            help="Only this outcome (success, failure, void, running, unjudged) or end reason (collision ...).",
        ),
    ] = "",
    disturb: Annotated[
        list[str] | None,
        typer.Option("--disturb", metavar="A,B@3", help="Only episodes with these disturbances; none: undisturbed."),
    ] = None,
    tag: Annotated[
        list[str] | None, typer.Option("--tag", metavar="A,B", help="Only episodes with all of these tags.")
    ] = None,
    note: Annotated[str, typer.Option("--note", metavar="WORDS", help="Only episodes whose notes say this.")] = "",
    limit: Annotated[
        int | None,
        typer.Option(
            "--limit",
            min=0,
            show_default="50, all with --json",
            help="Maximum number of episodes, the latest ones; 0 for all.",
        ),
    ] = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """List the latest episodes.

    [bold]vsnbench episodes list --model random --outcome collision[/bold]

    [bold]vsnbench episodes list --tag chair-moved[/bold]

    [bold]vsnbench episodes list --json | jq '.[] | select(.success) | .id'[/bold]
    """
    from vsnbench.cli.results.episode_page import metres
    from vsnbench.protocol.disturbances import NONE, parse_disturbances
    from vsnbench.results.annotations import read_tag
    from vsnbench.results.model import EPISODE
    from vsnbench.results.reading.filtering import OUTCOMES, EpisodeFilter
    from vsnbench.results.reading.queries import count_episodes, list_episodes

    if outcome and outcome not in OUTCOMES:
        raise UsageError(f"unknown outcome {outcome!r}", advice=f"use one of {', '.join(OUTCOMES)}")
    selected = EpisodeFilter(
        models=split_list(model),
        goals=split_list(goal),
        campaign=campaign,
        outcome=outcome,
        disturbances=None if not disturb else NONE if disturb == ["none"] else parse_disturbances(disturb),
        tags=tuple(map(read_tag, split_list(tag))),
        note=note,
    )
    maximum = (None if as_json else _TABLE_ROWS) if limit is None else limit or None
    with open_results(results, db) as (_, engine):
        episodes = list_episodes(engine, selected, maximum)
        if not episodes:
            _refuse_unknown(engine, selected)
        if as_json:
            print_json([EPISODE.json(episode) for episode in episodes])
            return
        total = count_episodes(engine, selected) if maximum and len(episodes) == maximum else len(episodes)
    if not episodes:
        typer.echo("no episodes found", err=True)
        return
    has_tags = any(episode.tags for episode in episodes)
    is_disturbed = any(episode.disturbances for episode in episodes)
    columns = (
        Column("episode"),
        name_column("model"),
        *([name_column("disturbed")] if is_disturbed else []),
        Column("goal", number=False),
        Column("start"),
        Column("result", number=False),
        Column("actions", rank=1),
        Column("to goal", rank=2),
        *([prose_column("tags")] if has_tags else []),
        Column("began (UTC)", number=False, rank=3),
    )
    rows = []
    for episode in episodes:
        color, why = COLORS[episode.outcome], episode.end_reason if episode.success is not True else None
        row = (
            str(episode.id),
            safe(episode.model),
            *([safe(episode.disturbances)] if is_disturbed else []),
            safe(episode.goal),
            str(episode.start) + (f" ({episode.repetition})" if episode.repetition > 1 else ""),
            f"[{color}]{episode.outcome}[/]" + (f": {safe(why)}" if why else ""),
            str(episode.actions),
            metres(episode.distance_m, episode.success_distance_m),
            *([safe(", ".join(episode.tags))] if has_tags else []),
            f"{episode.started_at:%Y-%m-%d %H:%M}",
        )
        rows.append(row)
    print_list(columns, rows)
    if total > len(episodes):
        typer.echo(f"latest {len(episodes)} of {total}; --limit 0 for all", err=True)


def _refuse_unknown(engine: "Engine", selected: "EpisodeFilter") -> None:
    """Refuse models and goals that are neither in the record nor known, and campaigns that do not exist.

    Raises:
        UsageError: there is one.
    """
    from vsnbench.models.names import known_models
    from vsnbench.results.reading.filtering import EpisodeFilter
    from vsnbench.results.reading.queries import count_episodes, list_campaigns, recorded_goals, recorded_models
    from vsnbench.sites.categories import GOAL_CATEGORIES
    from vsnbench.text.suggestions import unknown_name

    for kind, names, recorded, others in (
        ("model", selected.models, recorded_models(engine), known_models()),
        ("goal", selected.goals, recorded_goals(engine), GOAL_CATEGORIES),
    ):
        for name in names:
            if name not in recorded and name not in others:
                raise UsageError(unknown_name(kind, name, recorded, "this record"), code=f"unknown-{kind}")
    campaign = selected.campaign
    known = {name for state in list_campaigns(engine) for name in (str(state.id), state.name)}
    if campaign and campaign not in known and not count_episodes(engine, EpisodeFilter(campaign=campaign)):
        raise UsageError(
            f"campaign {campaign!r} does not exist",
            advice="`vsnbench db status` lists the campaigns",
            code="unknown-campaign",
        )


@app.command()
def show(
    number: Annotated[int, typer.Argument(help="Number of the episode.", min=1)],
    steps: Annotated[bool, typer.Option("--steps", help="Print every step on its own line.")] = False,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Show an episode: its result, verdicts, steps and provenance.

    [bold]vsnbench episodes show 17[/bold]

    [bold]vsnbench episodes show 17 --json | jq '.steps[].raw_action'[/bold]
    """
    from vsnbench.cli.results.episode_page import print_page
    from vsnbench.report.analysis.courses import measures_of
    from vsnbench.results.reading.queries import episode_record, episode_steps

    with open_results(results, db) as (place, engine):
        episode, recorded_steps = episode_record(engine, number), episode_steps(engine, number)
        measures = measures_of(engine, episode)
    directory = place.episode_directory(episode.images_directory) if episode.images_directory else None
    if as_json:
        print_json(_shown(episode, recorded_steps, measures, directory))
        return
    print_page(page(), episode, recorded_steps, measures, directory, every_step=steps)


def _shown(
    episode: "EpisodeRecord", steps: "tuple[StepRecord, ...]", measures: "CourseMeasures", directory: Path | None
) -> dict[str, object]:
    """Return an episode with its steps as JSON fields; they are stable. Unknown values are null."""
    from vsnbench.results.model import EPISODE_RECORD
    from vsnbench.results.step_fields import STEP

    return {
        **EPISODE_RECORD.json(episode),
        **asdict(measures),
        "directory": str(directory) if directory else None,
        "steps": [STEP.json(step) for step in steps],
    }
