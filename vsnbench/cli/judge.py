"""`vsnbench judge`: say what became of an episode, now or years later; what was said before stays in the record."""

import math
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.options import Database, Results
from vsnbench.cli.output import Json, print_json

if TYPE_CHECKING:
    from vsnbench.database.read_shapes import EpisodeDetails
    from vsnbench.protocol.judge import Verdict
    from vsnbench.record.results import ResultsDirectory

_WORD = "Your word: one of these"


def command(
    number: Annotated[int | None, typer.Argument(help="The episode's number.", min=1)] = None,
    distance: Annotated[
        str | None,
        typer.Option("--distance", help="measured to the nearest instance, metres, like 0.84", rich_help_panel=_WORD),
    ] = None,
    collision: Annotated[
        str | None, typer.Option("--collision", help="it touched this, and did not feel it", rich_help_panel=_WORD)
    ] = None,
    void: Annotated[
        str | None,
        typer.Option("--void", help="it is no result, and why; the trial is run again", rich_help_panel=_WORD),
    ] = None,
    confirm: Annotated[
        bool, typer.Option("--confirm", help="the protocol's proposal is right", rich_help_panel=_WORD)
    ] = False,
    note: Annotated[str, typer.Option("--note", help="Why, in your own words.")] = "",
    pending: Annotated[bool, typer.Option("--pending", help="List the episodes that await a person's word.")] = False,
    as_json: Json = False,
    results: Results = None,
    db: Database = None,
) -> None:
    """Judge an episode that has ended: your word stands, what stood before stays in the record.

    A real robot's result and an imported episode count only when somebody has judged them.
    Your name is $VSNBENCH_OPERATOR, else your login.

    [bold]Examples[/bold]

        vsnbench judge --pending
        vsnbench judge 17 --confirm
        vsnbench judge 17 --distance 0.84
        vsnbench judge 17 --collision "leg of the table"
        vsnbench judge 17 --void "somebody moved the chair" --note "see the video"
    """
    from vsnbench.errors import UsageError
    from vsnbench.record.results import ResultsDirectory

    place = ResultsDirectory.locate(results, db)
    words = [name for name, given in _words(distance, collision, void, confirm).items() if given]
    if pending:
        if number is not None or words:
            raise UsageError(
                "--pending lists episodes", advice="judge one of them with `vsnbench judge N` and your word"
            )
        _list_pending(place, as_json=as_json)
        return
    if number is None:
        raise UsageError("which episode? `vsnbench judge --pending` lists those that await a person's word")
    if len(words) != 1:
        said = f"{' and '.join(words)} contradict each other" if words else "nothing was said of it"
        raise UsageError(
            f"episode {number}: {said}", advice="give one of --distance, --collision, --void and --confirm"
        )
    _judge(place, number, distance=distance, collision=collision, void=void, note=note, as_json=as_json)


def _words(distance: str | None, collision: str | None, void: str | None, confirm: bool) -> dict[str, bool]:
    return {
        "--distance": distance is not None,
        "--collision": collision is not None,
        "--void": void is not None,
        "--confirm": confirm,
    }


def _judge(
    place: "ResultsDirectory",
    number: int,
    *,
    distance: str | None,
    collision: str | None,
    void: str | None,
    note: str,
    as_json: bool,
) -> None:
    from vsnbench.cli.episode_page import safe
    from vsnbench.database.journal import Journal
    from vsnbench.database.migrate import open_record
    from vsnbench.database.provenance import gather_provenance
    from vsnbench.database.queries import episode_details

    with open_record(place.database_url) as engine:
        details = episode_details(engine, number)
    verdict = _verdict(details, distance, collision, void)
    provenance = gather_provenance()
    with Journal.open(place.database_url, provenance) as journal:
        journal.judge(number, verdict, author=provenance.operator, note=note)
    if as_json:
        told = {"end_reason": verdict.end_reason.value, "success": verdict.success, "verdict": verdict.text}
        print_json({"id": number, **told, "author": provenance.operator, "note": note})
        return
    typer.echo(f"#{number} judged by {safe(provenance.operator)}: {safe(verdict.text)}")


def _verdict(details: "EpisodeDetails", distance: str | None, collision: str | None, void: str | None) -> "Verdict":
    from vsnbench.errors import UsageError
    from vsnbench.protocol.fix import PoseSource
    from vsnbench.protocol.judge import EndReason, GoalDistance
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.protocol.persons_word import collided, declared_void, metres, taped

    episode = details.summary
    if details.ended_with is None:
        raise UsageError(f"episode {episode.id} has not ended", advice="judge it when it has")
    if void is not None:
        return declared_void(_named(void, "--void", "why it is no result"))
    parameters = ProtocolParameters.from_record(details.provenance.protocol)
    if collision is not None:
        known = None
        if episode.distance_to_goal_m is not None and episode.distance_source is not None:
            source = PoseSource(episode.distance_source)
            known = GoalDistance(episode.distance_to_goal_m, source, details.goal_instance or "")
        what = _named(collision, "--collision", "what it touched")
        return collided(what, episode.actions, known, parameters)
    if distance is not None:
        measured_m = metres(distance, _longest_m(details.provenance.site_content))
        ended_with = EndReason(details.ended_with)
        if not ended_with.is_result:
            raise UsageError(
                f"episode {episode.id} ended with {ended_with.value}, without a STOP: no distance makes a result of it",
                advice="if it touched something, --collision WHAT; else --void WHY",
            )
        return taped(ended_with, episode.actions, measured_m, details.goal_instance or "", parameters)
    return _proposal(details)


def _named(text: str, option: str, what: str) -> str:
    from vsnbench.errors import UsageError

    words = " ".join(text.split())
    if not words:
        raise UsageError(f"{option} needs to say {what}")
    return words


def _longest_m(content: dict[str, object]) -> float:
    """Return the longest distance within the site as it was recorded; a tape's length where it was never surveyed."""
    from pydantic import ValidationError
    from shapely.geometry import MultiPoint

    from vsnbench.protocol.persons_word import LONGEST_M
    from vsnbench.protocol.site import Site

    try:
        corners = [corner for room in Site.model_validate(content).rooms for corner in room.polygon]
    except ValidationError:
        return LONGEST_M
    west, south, east, north = MultiPoint(corners).bounds
    return min(LONGEST_M, math.hypot(east - west, north - south))


def _proposal(details: "EpisodeDetails") -> "Verdict":
    from vsnbench.database.lifecycle import EpisodeState
    from vsnbench.errors import UsageError
    from vsnbench.protocol.fix import PoseSource
    from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict

    number = details.summary.id
    if details.summary.state != EpisodeState.AWAITING:
        raise UsageError(
            f"episode {number} awaits nobody's word ({details.summary.outcome})",
            advice="amend its verdict with --distance, --collision or --void",
        )
    if not details.verdicts:
        raise UsageError(
            f"episode {number} has no proposal to confirm", advice="give --distance, --collision or --void"
        )
    given = details.verdicts[-1]
    distance = None
    if given.distance_m is not None and given.distance_source is not None:
        source, instance = PoseSource(given.distance_source), given.goal_instance or ""
        distance = GoalDistance(given.distance_m, source, instance, given.goal_in_sight is not False)
    return Verdict(EndReason(given.end_reason), given.success, given.reason, distance)


def _list_pending(place: "ResultsDirectory", *, as_json: bool) -> None:
    from vsnbench.cli.episode_page import safe
    from vsnbench.cli.listing import ListColumn, name_column, print_list, prose_column
    from vsnbench.database.migrate import open_record
    from vsnbench.database.queries import pending_episodes
    from vsnbench.protocol.judge import EndReason

    with open_record(place.database_url) as engine:
        waiting = pending_episodes(engine)
    if as_json:
        told = [
            {
                "id": one.id,
                "model": one.model,
                "robot": one.robot,
                "goal": one.goal,
                "start": one.start,
                "repetition": one.repetition,
                "origin": one.origin,
                "proposal": one.proposal,
                "proposed_success": one.proposed_success,
                "ended_at": one.ended_at.isoformat(),
            }
            for one in waiting
        ]
        print_json(told)
        return
    if not waiting:
        typer.echo("no episode awaits a person's word", err=True)
        return
    columns = (
        ListColumn("episode", right=True),
        name_column("model"),
        ListColumn("goal"),
        ListColumn("start", right=True),
        ListColumn("ended (UTC)", rank=1),
        prose_column("proposal"),
    )
    rows = []
    for one in waiting:
        start = str(one.start) + (f" ({one.repetition})" if one.repetition > 1 else "")
        proposal = one.proposal or f"none: it was {one.origin}, and ended with {one.end_reason}"
        if not one.proposal and not EndReason(one.end_reason).is_result:
            proposal += ": --collision WHAT or --void WHY"
        ended = f"{one.ended_at:%Y-%m-%d %H:%M}"
        rows.append((str(one.id), safe(one.model), safe(one.goal), start, ended, safe(proposal)))
    print_list(columns, rows)
    ways = ["--confirm"] if any(one.proposal for one in waiting) else []
    ways += ["--distance 0.84"] if any(one.end_reason == EndReason.STOP.value for one in waiting) else []
    typer.echo(f"vsnbench judge N {', or '.join([*ways, '--void WHY'])} ...{place.options}", err=True)
