"""`vsnbench episodes`: list recorded episodes and show one of them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.options import Database, Results
from vsnbench.cli.output import Json, print_json

if TYPE_CHECKING:
    from vsnbench.database.read_shapes import EpisodeDetails, EpisodeSummary
    from vsnbench.protocol.step_record import StepRecord

app = typer.Typer(no_args_is_help=True, rich_markup_mode="rich")

_TABLE_ROWS = 50


@app.command("list")
def list_(
    model: Annotated[str, typer.Option("--model", help="Only this model's.")] = "",
    goal: Annotated[str, typer.Option("--goal", help="Only this goal category.")] = "",
    campaign: Annotated[
        str, typer.Option("--campaign", help="Only this campaign: its number, name, or 8 digits or more of its key.")
    ] = "",
    outcome: Annotated[
        str,
        typer.Option(
            "--outcome",
            help="Only success, failure, void, running or unjudged ones, or those with this end reason (collision...).",
        ),
    ] = "",
    limit: Annotated[
        int | None,
        typer.Option("--limit", min=0, help="Only the latest so many; 0 for all. 50 in a table, all with --json."),
    ] = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """List episodes, the latest ones when there are many.

    [bold]vsnbench episodes list --model random --outcome collision[/bold]

    [bold]vsnbench episodes list --json | jq '.[] | select(.success) | .id'[/bold]
    """
    from vsnbench.cli.episode_page import COLORS, metres, safe
    from vsnbench.cli.listing import ListColumn, name_column, print_list
    from vsnbench.database.migrate import open_record
    from vsnbench.database.queries import count_episodes, list_episodes
    from vsnbench.database.read_shapes import OUTCOMES, EpisodeFilter
    from vsnbench.errors import UsageError
    from vsnbench.record.results import ResultsDirectory

    if outcome and outcome not in OUTCOMES:
        raise UsageError(f"no outcome {outcome!r}: there are {', '.join(OUTCOMES)}")
    which = EpisodeFilter(model=model, goal=goal, campaign=campaign, outcome=outcome)
    most = (None if as_json else _TABLE_ROWS) if limit is None else limit or None
    with open_record(ResultsDirectory.locate(results, db).database_url) as engine:
        episodes = list_episodes(engine, which, most)
        if as_json:
            print_json([_summary_object(episode) for episode in episodes])
            return
        total = count_episodes(engine, which) if most and len(episodes) == most else len(episodes)
    if not episodes:
        typer.echo("no such episodes", err=True)
        return
    columns = (
        ListColumn("episode", right=True),
        name_column("model"),
        ListColumn("goal"),
        ListColumn("start", right=True),
        ListColumn("result"),
        ListColumn("actions", right=True, rank=1),
        ListColumn("to goal", right=True, rank=2),
        ListColumn("began (UTC)", rank=3),
    )
    rows = []
    for episode in episodes:
        color, why = COLORS[episode.outcome], episode.end_reason if episode.success is not True else None
        row = (
            str(episode.id),
            safe(episode.model),
            safe(episode.goal),
            str(episode.start) + (f" ({episode.repetition})" if episode.repetition > 1 else ""),
            f"[{color}]{episode.outcome}[/]" + (f": {safe(why)}" if why else ""),
            str(episode.actions),
            metres(episode.distance_to_goal_m),
            f"{episode.started_at:%Y-%m-%d %H:%M}",
        )
        rows.append(row)
    print_list(columns, rows)
    if total > len(episodes):
        typer.echo(f"the latest {len(episodes)} of {total}; --limit 0 shows all", err=True)


@app.command()
def show(
    number: Annotated[int, typer.Argument(help="The episode's number.", min=1)],
    steps: Annotated[bool, typer.Option("--steps", help="Every step, one a line.")] = False,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Show one episode: how it went, its verdicts, what was asked and done, and what the result depends on.

    [bold]vsnbench episodes show 17[/bold]

    [bold]vsnbench episodes show 17 --json | jq '.steps[].raw_action'[/bold]
    """
    from vsnbench.cli.episode_page import page, print_page
    from vsnbench.database.migrate import open_record
    from vsnbench.database.queries import episode_details, episode_steps
    from vsnbench.record.results import ResultsDirectory

    place = ResultsDirectory.locate(results, db)
    with open_record(place.database_url) as engine:
        details, taken = episode_details(engine, number), episode_steps(engine, number)
    directory = place.episode_directory(details.summary.images_directory) if details.summary.images_directory else None
    if as_json:
        print_json(_details_object(details, taken, directory))
        return
    print_page(page(), details, taken, directory, every_step=steps)


def _summary_object(episode: "EpisodeSummary") -> dict[str, object]:
    """Return what `--json` promises of every episode."""
    return {
        "id": episode.id,
        "uuid": episode.uuid,
        "campaign": episode.campaign,
        "campaign_id": episode.campaign_id,
        "model": episode.model,
        "robot": episode.robot,
        "simulated": episode.simulated,
        "site": episode.site,
        "goal": episode.goal,
        "start": episode.start,
        "repetition": episode.repetition,
        "origin": episode.origin,
        "outcome": episode.outcome,
        "end_reason": episode.end_reason,
        "success": episode.success,
        "actions": episode.actions,
        "distance_to_goal_m": episode.distance_to_goal_m,
        "distance_source": episode.distance_source,
        "collision": episode.collision,
        "path_length_m": episode.path_length_m,
        "shortest_path_m": episode.geodesic_start_m,
        "duration_s": episode.duration_s,
        "started_at": episode.started_at.isoformat(),
        "ended_at": episode.ended_at.isoformat() if episode.ended_at else None,
        "images_directory": episode.images_directory,
    }


def _details_object(
    details: "EpisodeDetails", steps: "tuple[StepRecord, ...]", directory: Path | None
) -> dict[str, object]:
    from dataclasses import asdict

    whole = asdict(details)
    del whole["summary"]
    return {
        **_summary_object(details.summary),
        **whole,
        "directory": str(directory) if directory else None,
        "steps": [_step_object(step) for step in steps],
    }


def _step_object(step: "StepRecord") -> dict[str, object]:
    """Return what `--json` promises of every step: as the table has it, with null for what is not known."""
    from dataclasses import asdict

    from vsnbench.database.row_encoding import number

    result = step.result
    collision = result.collision if result else None
    return {
        "number": step.number,
        "raw_action": step.raw_action,
        "action": step.action,
        "blocked": step.blocked,
        "completed": result is not None and result.completed,
        "failure": result.failure if result else "",
        "recorded_at": step.recorded_at,
        "stamp_s": step.stamp_s,
        "observed": asdict(step.observed) if step.observed else None,
        "after": asdict(step.after) if step.after else None,
        "world": asdict(step.world) if step.world else None,
        "displacement_m": number(result.displacement_m) if result else 0.0,
        "turn_rad": number(result.turn_rad) if result else 0.0,
        "duration_s": number(result.duration_s) if result else 0.0,
        "corrections": result.corrections if result else 0,
        "collision_source": collision.source if collision else None,
        "collision_touched": collision.touched if collision else None,
        "rgb_digest": step.rgb_digest,
        "depth_digest": step.depth_digest,
        **asdict(step.timings),
        "probabilities": step.probabilities,
        "details": step.details,
    }
