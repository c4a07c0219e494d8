"""`vsnbench judge --second`: another person judges episodes without the first verdict and the model's name."""

import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING

import typer

from vsnbench.cli.support.output import print_result
from vsnbench.cli.support.terminal import safe
from vsnbench.errors import UsageError

if TYPE_CHECKING:
    from vsnbench.results.files.directory import ResultsDirectory
    from vsnbench.runner.judging.decision import Answer


@dataclass(frozen=True, slots=True)
class SecondOptions:
    """Options of `vsnbench judge` that only go with `--second`."""

    sample: int | None
    seed: int
    port: int
    retract: bool


def judge_second(
    place: "ResultsDirectory",
    rater: str,
    number: int | None,
    answers: "dict[str, Answer]",
    options: SecondOptions,
    *,
    as_json: bool,
) -> None:
    """Serve the rater's page, or record or retract one answer of the rater.

    Raises:
        UsageError: options contradict each other, or the rater cannot judge.
    """
    from vsnbench.runner.judging.second import read_rater

    name = read_rater(rater)
    if number is None:
        if answers or options.retract:
            option = next(iter(answers), "--retract")
            raise UsageError(f"{option} needs an episode", advice="give its number, or leave it out for the page")
        _serve(place, name, options, as_json=as_json)
        return
    if options.sample is not None:
        raise UsageError("--sample is for the page", advice="leave out the number of the episode")
    if len(answers) + options.retract != 1:
        raise UsageError(
            f"episode {number}: give one answer",
            advice="--distance, --collision, --void, --confirm (it ended as recorded) or --retract",
        )
    _answer(place, name, number, next(iter(answers.values()), None), as_json=as_json)


def _answer(place: "ResultsDirectory", rater: str, number: int, answer: "Answer | None", *, as_json: bool) -> None:
    """Record an answer, or retract the rater's answer if there is none."""
    from vsnbench.results.reading.queries import episode_details
    from vsnbench.results.schema.migrate import open_record
    from vsnbench.results.writing.journal import Journal
    from vsnbench.runner.judging.second import blind_case, decide_second

    with open_record(place.database_url) as engine:
        case = blind_case(episode_details(engine, number))
    if answer is None:
        with Journal.open(place.database_url) as journal:
            journal.retract_second(number, rater)
        outcome, words = None, "retracted"
    else:
        outcome, words = decide_second(case, answer)
        with Journal.open(place.database_url) as journal:
            journal.judge_second(number, rater, outcome, words)
    result = words if outcome is None else f"{outcome} ({words})"
    text = f"episode {number}, second judgement by {safe(rater)}: {safe(result)}"
    print_result({"id": number, "rater": rater, "outcome": outcome, "text": words}, text, as_json=as_json)


def _serve(place: "ResultsDirectory", rater: str, options: SecondOptions, *, as_json: bool) -> None:
    """Serve the rater's page until Ctrl-C."""
    from vsnbench.results.schema.migrate import open_record
    from vsnbench.results.writing.journal import Journal
    from vsnbench.runner.judging.second import SecondRating
    from vsnbench.web.second_judgement.app import SecondJudgementApp
    from vsnbench.web_server.server import WebServer
    from vsnbench.web_server.session_key import SessionKey

    with open_record(place.database_url):
        pass  # a page for an empty directory would create a record
    with Journal.open(place.database_url) as journal:
        rating = SecondRating(journal, place, rater, options.sample, options.seed)
        answered, total = len(rating.answers()), len(rating.codes)
        key = SessionKey.stored(f"second {place.path.resolve()} {rater} {options.port}")
        with WebServer(SecondJudgementApp(rating).routes(), key, port=options.port) as server:
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
