"""An operator's answer gives the same verdict and checks in every interface."""

import io
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from rich.console import Console

from tests.cli.test_record_verbs import vsnbench
from tests.results.records_of_a_lab import stopped
from tests.web.page_session import PageSession, page_session
from vsnbench.results.reading.queries import episode_record
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.runner.operator.contract import Display, EndedEpisode, Judgement
from vsnbench.runner.operator.prompts import OperatorPrompts, QuestionKind
from vsnbench.runner.operator.terminal import TerminalOperator
from vsnbench.runner.stopping.emergency_key import EmergencyStop
from vsnbench.runner.stopping.requests import Stopped, StopRequests
from vsnbench.runner.study.blinding import hide_end


@dataclass(frozen=True)
class Given:
    """An operator's answer about an episode that stopped 0.40 m from the goal in a room of 4 m by 4 m."""

    distance: str = ""
    touched: str = ""


@dataclass(frozen=True)
class Outcome:
    """Result of an answer; no verdict if the answer was refused."""

    asked_back: bool
    success: bool | None = None
    end_reason: str = ""
    verdict: str = ""
    note: str = ""


def ended(session: PageSession) -> EndedEpisode:
    """Episode 1 as the session recorded it."""
    assert session.prompts.state.upcoming is not None
    verdict = stopped(success=True).verdict
    assert verdict is not None
    return EndedEpisode(1, session.prompts.state.upcoming.plan, EpisodeEnd(verdict, 3, None, 1.0, proposed=True))


def outcome_of(judgement: Judgement | None, *, asked_back: bool) -> Outcome:
    if judgement is None:
        return Outcome(asked_back)
    verdict = judgement.verdict
    return Outcome(asked_back, verdict.success, verdict.end_reason.value, verdict.text, judgement.note)


def recorded(session: PageSession, *, asked_back: bool) -> Outcome:
    verdict = episode_record(session.journal.engine, 1).current_verdict
    if verdict is None:
        return Outcome(asked_back)
    return Outcome(asked_back, verdict.success, verdict.end_reason, verdict.reason, verdict.note)


class Person(Display):
    """Types the answers at a terminal."""

    def __init__(self, given: Given) -> None:
        self.console = Console(file=io.StringIO(), width=300)
        self.given = given
        self.asked_back = False
        self.left = [given.distance or "keep"]

    @contextmanager
    def paused(self):
        yield

    def read_line(self) -> str:
        prompt = self.console.file.getvalue().splitlines()[-1]
        if "touch anything" in prompt:
            return self.given.touched or "no"
        if "A collision with" in prompt:  # the terminal repeats the typed answer, unlike buttons and options
            return "yes"
        if "Is that right" in prompt:
            self.asked_back = True
            return "yes"
        if not self.left:
            raise EOFError
        return self.left.pop()


def at_the_terminal(session: PageSession, given: Given, *, blind: bool = False) -> Outcome:
    person, stop, prompts = Person(given), StopRequests(), OperatorPrompts()
    prompts.read_line = person.read_line
    operator = TerminalOperator(person, EmergencyStop(lambda: None, stop.ask), stop, prompts)
    try:
        judgement = operator.judge(hide_end(ended(session)) if blind else ended(session))
    except Stopped:
        judgement = None
    return outcome_of(judgement, asked_back=person.asked_back)


def in_a_study(session: PageSession, given: Given) -> Outcome:
    return at_the_terminal(session, given, blind=True)


def at_the_page(session: PageSession, given: Given) -> Outcome:
    """Answer the question that the run asks."""
    anna, said = session.browser("Anna"), {"distance": given.distance, "touched": given.touched or "no"}
    session.prompts.state.episode_ended(ended(session))
    with session.prompts.ask(QuestionKind.JUDGE) as question, ThreadPoolExecutor() as pool:
        said |= {"question": question.number, "episode": 1}
        answer = pool.submit(anna.post, "/judge", **said)
        while question.answer is None and not answer.done():
            time.sleep(0.001)
        asked_back = answer.done() and answer.result().json.get("needs_confirmation") is True
        if asked_back:
            answer = pool.submit(anna.post, "/judge", **said, confirmed=True)
            while question.answer is None:
                assert not answer.done(), answer.result()
                time.sleep(0.001)
        if question.answer is None:
            return Outcome(asked_back)
        judgement = question.answer
        assert isinstance(judgement, Judgement)
        session.journal.judge(1, judgement.verdict, author="Anna", note=judgement.note, seen=1)
        assert answer.result().status == 200
    return recorded(session, asked_back=asked_back)


def in_the_pages_list(session: PageSession, given: Given) -> Outcome:
    """Judge an episode that awaits a judgement."""
    anna, said = session.browser("Anna"), {"distance": given.distance, "touched": given.touched or "no"}
    first = anna.post("/amend", episode=1, seen=1, **said)
    asked_back = first.json.get("needs_confirmation") is True
    if asked_back:
        assert anna.post("/amend", episode=1, seen=1, confirmed=True, **said).status == 200
    return recorded(session, asked_back=asked_back)


def by_the_command(session: PageSession, given: Given) -> Outcome:
    """Judge with `vsnbench judge`."""
    answer = ["--collision", given.touched] if given.touched else ["--distance", given.distance]
    if not (given.touched or given.distance):
        answer = ["--confirm"]
    results = Path(str(session.journal.engine.url.database)).parent
    done = vsnbench(results, "judge", "1", *answer)
    asked_back = "add --yes" in done.stderr
    if asked_back:
        assert vsnbench(results, "judge", "1", *answer, "--yes").returncode == 0
    return recorded(session, asked_back=asked_back)


FACES: tuple[Callable[[PageSession, Given], Outcome], ...] = (
    at_the_terminal,
    in_a_study,
    at_the_page,
    in_the_pages_list,
    by_the_command,
)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (Given(), (False, True, "stop")),
        (Given(distance="0.5"), (False, True, "stop")),
        (Given(distance="1.3"), (True, False, "stop")),
        (Given(distance="1"), (True, False, "stop")),
        (Given(distance="300 cm"), (True, False, "stop")),
        (Given(distance="84"), (False, None, "")),
        (Given(distance="5.7"), (False, None, "")),
        (Given(touched="the cat"), (False, False, "collision")),
    ],
)
def test_an_answer_has_the_same_checks_and_verdict_everywhere(
    tmp_path: Path, given: Given, expected: tuple[bool, bool | None, str]
) -> None:
    outcomes = {}
    for face in FACES:
        with page_session(tmp_path / face.__name__) as session:
            outcomes[face.__name__] = face(session, given)
    first = outcomes[FACES[0].__name__]
    assert (first.asked_back, first.success, first.end_reason) == expected
    assert outcomes == dict.fromkeys(outcomes, first)


@pytest.mark.parametrize("face", [in_the_pages_list, by_the_command])
def test_a_retracted_judgement_is_never_proposed_again(tmp_path: Path, face: Callable[..., Outcome]) -> None:
    with page_session(tmp_path) as session:
        anna = session.browser("Anna")
        assert anna.post("/amend", episode=1, seen=1, touched="a slip of the finger").status == 200
        assert anna.post("/undo", episode=1, seen=2).status == 200
        details = episode_record(session.journal.engine, 1)
        assert (details.current_verdict, details.proposal) == (None, details.verdicts[0])
        said = {"touched": "no", "distance": ""}
        if face is by_the_command:
            outcome = face(session, Given())
        else:
            assert anna.post("/amend", episode=1, seen=2, **said).status == 200
            outcome = recorded(session, asked_back=False)
    assert (outcome.success, outcome.end_reason, outcome.verdict) == (True, "stop", "judged")


def test_vsnbench_judge_is_refused_when_another_judges_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from vsnbench.runner.judging import decision

    with page_session(tmp_path) as session:
        decide = decision.decide

        def after_ben(*given: object) -> Judgement:
            ben = session.browser("Ben")
            assert ben.post("/amend", episode=1, seen=1, touched="the bin").status == 200
            return decide(*given)

        monkeypatch.setattr("vsnbench.runner.judging.decision.decide", after_ben)
        done = vsnbench(tmp_path / "results", "judge", "1", "--confirm")
        assert (done.returncode, "Ben" in done.stderr) == (1, True)
        assert len(episode_record(session.journal.engine, 1).verdicts) == 2
