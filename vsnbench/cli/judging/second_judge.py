"""`vsnbench judge --second`: another person judges episodes without the first verdict and the model's name."""

import threading
from collections.abc import Sequence

import typer

from vsnbench.cli.support.output import print_result
from vsnbench.cli.support.terminal import safe
from vsnbench.errors import UsageError
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.reading.queries import episode_record
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.judging.decision import Answer
from vsnbench.runner.judging.second import SecondRating, blind_case, decide_second, read_rater


def answer_second(
    place: ResultsDirectory, rater: str, number: int, answers: Sequence[Answer], *, retract: bool, as_json: bool
) -> None:
    """Record one answer of a rater, or retract it.

    Raises:
        UsageError: there is not one answer, or the rater cannot judge.
    """
    rater = read_rater(rater)
    if len(answers) + retract != 1:
        raise UsageError(
            f"episode {number}: give one answer",
            advice="--distance, --collision, --void, --confirm (it ended as recorded) or --retract",
        )
    with open_record(place.database_url, reads_copy=False) as engine:
        case = blind_case(episode_record(engine, number))
    if retract:
        with Journal.open(place.database_url) as journal:
            journal.retract_second(number, rater)
        outcome, words = None, "retracted"
    else:
        outcome, words = decide_second(case, answers[0])
        with Journal.open(place.database_url) as journal:
            journal.judge_second(number, rater, outcome, words)
    result = words if outcome is None else f"{outcome} ({words})"
    text = f"episode {number}, second judgement by {safe(rater)}: {safe(result)}"
    print_result({"id": number, "rater": rater, "outcome": outcome, "text": words}, text, as_json=as_json)


def serve_second(
    place: ResultsDirectory, rater: str, *, sample: int | None, seed: int, port: int, as_json: bool
) -> None:
    """Serve the page of a rater until Ctrl-C.

    Raises:
        UsageError: the rater cannot judge.
    """
    from vsnbench.web.second_judgement.app import SecondJudgementApp
    from vsnbench.web_server.server import WebServer
    from vsnbench.web_server.session_key import SessionKey

    rater = read_rater(rater)
    with open_record(place.database_url, reads_copy=False):
        pass  # a page for an empty directory would create a record
    with Journal.open(place.database_url) as journal:
        rating = SecondRating(journal, place, rater, sample, seed)
        answered, total = len(rating.answers()), len(rating.codes)
        key = SessionKey.stored(f"second {place.path.resolve()} {rater} {port}")
        with WebServer(SecondJudgementApp(rating).routes(), key, port=port) as server:
            (address, *_) = server.addresses
            fields = {"rater": rater, "episodes": total, "answered": answered, "address": address}
            print_result(fields, address, as_json=as_json)
            own = f"; {rating.own_episodes} left out that {rater} judged or attended" if rating.own_episodes else ""
            typer.echo(
                f"{answered} of {total} episodes answered{own}; Ctrl-C to stop, the same command resumes", err=True
            )
            try:
                threading.Event().wait()
            except KeyboardInterrupt:
                typer.echo(f"{len(rating.answers())} of {total} episodes answered", err=True)
