"""`vsnbench judge`: judge recorded episodes; earlier verdicts stay in the record."""

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support.listing import name_column, print_list, prose_column
from vsnbench.cli.support.options import Database, Results, options_under, results_directory
from vsnbench.cli.support.output import Json, confirm, print_json, print_result
from vsnbench.cli.support.terminal import safe
from vsnbench.errors import UsageError
from vsnbench.report.table import Column
from vsnbench.text.sanitize import sanitize

if TYPE_CHECKING:
    from vsnbench.results.files.directory import ResultsDirectory
    from vsnbench.results.model import RecordedVerdict
    from vsnbench.runner.judging.case import Case
    from vsnbench.runner.judging.decision import Answer
    from vsnbench.runner.operator.contract import Judgement

PENDING_FIELDS = ("id", "model", "robot", "goal", "start", "repetition", "origin", "ended_at")
"""Quantities of the episodes that `--pending --json` lists."""
_answer_option = options_under("Judgement (one of these)")
_second_option = options_under("Blind second judgement")


def command(  # noqa: PLR0913 - Typer needs a parameter per option
    number: Annotated[int | None, typer.Argument(help="Number of the episode.", min=1)] = None,
    distance: Annotated[
        str | None,
        _answer_option(
            "--distance",
            help="Distance to the nearest goal instance by tape measure, in metres; or odometry, if its pose is right, "
            "not the one from images.",
        ),
    ] = None,
    collision: Annotated[
        str | None, _answer_option("--collision", help="Object that the robot touched without detecting it.")
    ] = None,
    void: Annotated[
        str | None, _answer_option("--void", help="Reason why the episode is not a result; its trial runs again.")
    ] = None,
    confirm: Annotated[bool, _answer_option("--confirm", help="Accept the proposed verdict.")] = False,
    note: Annotated[str, typer.Option("--note", help="Note for the record.")] = "",
    yes: Annotated[
        bool,
        typer.Option(
            "--yes", "-y", help="Do not ask; needed in scripts to change a verdict or confirm an unlikely one."
        ),
    ] = False,
    pending: Annotated[bool, typer.Option("--pending", help="List episodes that await judgement.")] = False,
    second: Annotated[
        str | None,
        _second_option(
            "--second",
            metavar="RATER",
            help="Judge as a second person, without the first verdict and the model's name. Without an episode: in a "
            "browser.",
        ),
    ] = None,
    sample: Annotated[
        int | None, _second_option("--sample", min=1, show_default="all", help="Number of episodes, drawn at random.")
    ] = None,
    seed: Annotated[int, _second_option("--seed", help="Seed of sample and order.")] = 0,
    port: Annotated[
        int, _second_option("--port", min=0, max=65535, help="Port of the page; 0 for any free port.")
    ] = 8730,
    retract: Annotated[bool, _second_option("--retract", help="Retract the rater's answer.")] = False,
    as_json: Json = False,
    results: Results = None,
    db: Database = None,
) -> None:
    """Judge an episode that has ended. The latest judgement counts; earlier ones stay in the record.

    Episodes of real robots and imported episodes count only after a judgement.
    The author is $VSNBENCH_OPERATOR, else the login name.

    [bold]Examples[/bold]

        vsnbench judge --pending
        vsnbench judge 17 --confirm
        vsnbench judge 17 --distance 0.84
        vsnbench judge 17 --collision "leg of the table"
        vsnbench judge 17 --void "a visitor moved the chair" --yes
        vsnbench judge --second Grace --sample 40
    """
    from vsnbench.runner.judging.decision import Answer, AnswerKind

    place = results_directory(results, db)
    given = {
        "--distance": (AnswerKind.MEASURED, distance),
        "--collision": (AnswerKind.COLLISION, collision),
        "--void": (AnswerKind.VOID, void),
        "--confirm": (AnswerKind.CONFIRM, "" if confirm else None),
    }
    answers = {option: Answer(kind, text, note) for option, (kind, text) in given.items() if text is not None}
    if second is not None:
        from vsnbench.cli.judging.second_judge import answer_second, serve_second

        if pending or yes:
            raise UsageError(f"--second does not go with {'--pending' if pending else '--yes'}", advice="leave it out")
        if number is None:
            if answers or retract:
                option = next(iter(answers), "--retract")
                raise UsageError(f"{option} needs an episode", advice="give its number, or leave it out for the page")
            serve_second(place, second, sample=sample, seed=seed, port=port, as_json=as_json)
            return
        if sample is not None:
            raise UsageError("--sample is for the page", advice="leave out the number of the episode")
        answer_second(place, second, number, tuple(answers.values()), retract=retract, as_json=as_json)
        return
    if sample is not None or retract:
        raise UsageError(f"{'--retract' if retract else '--sample'} goes with --second RATER")
    if pending:
        if number is not None or answers:
            raise UsageError("--pending lists episodes", advice="judge one of them with `vsnbench judge N`")
        _list_pending(place, as_json=as_json)
        return
    if number is None:
        raise UsageError(
            "no episode given", advice="`vsnbench judge --pending` lists those that await judgement", code="no-episode"
        )
    if len(answers) != 1:
        problem = f"{' and '.join(answers)} contradict each other" if answers else "no judgement given"
        raise UsageError(
            f"episode {number}: {problem}", advice="give one of --distance, --collision, --void and --confirm"
        )
    (answer,) = answers.values()
    _judge(place, number, answer, yes=yes, as_json=as_json)


def _judge(place: "ResultsDirectory", number: int, answer: "Answer", *, yes: bool, as_json: bool) -> None:
    from vsnbench.results.reading.queries import episode_record
    from vsnbench.results.schema.migrate import open_record
    from vsnbench.results.writing.journal import Journal
    from vsnbench.results.writing.provenance import gather_provenance
    from vsnbench.runner.judging.case import Case

    with open_record(place.database_url, reads_copy=False) as engine:
        details = episode_record(engine, number)
    judgement = _decided(Case.of_recorded(details), replace(answer, is_confirmed=yes))
    verdict, provenance = judgement.verdict, gather_provenance()
    with Journal.open(place.database_url, provenance) as journal:
        seen = len(details.verdicts)
        journal.judge(number, verdict, author=provenance.operator, note=judgement.note, seen=seen)
    fields = {"id": number, "end_reason": verdict.end_reason, "success": verdict.success, "verdict": verdict.text}
    text = f"episode {number} judged by {safe(provenance.operator)}: {safe(verdict.text)}"
    print_result(fields | {"author": provenance.operator, "note": judgement.note}, text, as_json=as_json)


def _decided(case: "Case", answer: "Answer") -> "Judgement":
    """Return the judgement; ask for a confirmation on a terminal if the answer needs one."""
    from vsnbench.runner.judging.decision import UnconfirmedAnswerError, decide

    try:
        return decide(case, answer)
    except UnconfirmedAnswerError as doubt:
        confirm(doubt.statement, f"{sanitize(doubt.statement)}. Confirm?", "nothing was written")
        return decide(case, replace(answer, is_confirmed=True))


def _list_pending(place: "ResultsDirectory", *, as_json: bool) -> None:
    from vsnbench.protocol.judge import EndReason
    from vsnbench.results.model import EPISODE
    from vsnbench.results.reading.filtering import EpisodeFilter
    from vsnbench.results.reading.queries import list_episodes, proposals
    from vsnbench.results.schema.migrate import open_record

    with open_record(place.database_url) as engine:
        pending = list_episodes(engine, EpisodeFilter(outcome="unjudged"))
        proposed = proposals(engine, [episode.id for episode in pending])
    if as_json:
        fields = EPISODE.only(*PENDING_FIELDS)
        print_json([{**fields.json(episode), **_proposed(proposed.get(episode.id))} for episode in pending])
        return
    if not pending:
        typer.echo("no episode awaits judgement", err=True)
        return
    columns = (
        Column("episode"),
        name_column("model"),
        Column("goal", number=False),
        Column("start"),
        Column("ended (UTC)", number=False, rank=1),
        prose_column("proposal"),
    )
    rows = []
    for episode in pending:
        start = str(episode.start) + (f" ({episode.repetition})" if episode.repetition > 1 else "")
        proposal = f"none ({episode.origin}, ended with {episode.ended_with})"
        if episode.id in proposed:
            proposal = proposed[episode.id].reason
        elif not EndReason(str(episode.ended_with)).is_result:
            proposal += "; give --collision OBJECT or --void REASON"
        ended = f"{episode.ended_at:%Y-%m-%d %H:%M}" if episode.ended_at else "hidden"
        rows.append((str(episode.id), safe(episode.model), safe(episode.goal), start, ended, safe(proposal)))
    print_list(columns, rows)
    options = ["--confirm"] if proposed else []
    options += ["--distance 0.84"] if any(episode.ended_with == EndReason.STOP.value for episode in pending) else []
    typer.echo(f"vsnbench judge N {', or '.join([*options, '--void REASON'])} ...{place.options}", err=True)


def _proposed(verdict: "RecordedVerdict | None") -> dict[str, object]:
    return {
        "proposal": verdict.reason if verdict else None,
        "proposed_success": verdict.success if verdict else None,
    }
