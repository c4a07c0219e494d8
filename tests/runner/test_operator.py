"""The person at the terminal: asked where it matters, believed over the odometry, and never asked in vain."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import pytest
from rich.console import Console

from vsnbench.errors import RobotError, UsageError
from vsnbench.protocol.fix import PoseSource
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict, judge
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import StartingPosition
from vsnbench.robots.profiles import load_profile
from vsnbench.runner.emergency_stop import EmergencyStop
from vsnbench.runner.episode import EpisodeOutcome
from vsnbench.runner.operator import Absent, Operator, require_operator

START = StartingPosition(number=4, position=(2.5, 1.25), heading_deg=90, note="by the sofa")
PARAMETERS = ProtocolParameters()


class Terminal:
    """A display that keeps what is written, and a person whose answers are known beforehand."""

    def __init__(self, *answers: str) -> None:
        self.console = Console(file=io.StringIO(), width=300)
        self.answers = list(answers)
        self.questions: list[str] = []
        self.ended: list[int] = []

    @contextmanager
    def paused(self) -> Iterator[None]:
        yield

    def episode_begins(self, goal: str, start: int) -> None: ...

    def episode_ends(self, number: int, goal: str, start: int, outcome: EpisodeOutcome) -> None:
        self.ended.append(number)

    def read_line(self, question: str) -> str:
        self.questions.append(question)
        return self.answers.pop(0)

    @property
    def text(self) -> str:
        return self.console.file.getvalue()


@dataclass
class Notebook:
    """Keeps what the person adds to the record in lists."""

    verdicts: list[Verdict] = field(default_factory=list)
    interventions: list[tuple[int, int, str]] = field(default_factory=list)

    def verdict(self, episode_id: int, verdict: Verdict) -> None:
        self.verdicts.append(verdict)

    def intervention(self, episode_id: int, step_number: int, what: str) -> None:
        self.interventions.append((episode_id, step_number, what))


def operator_at(terminal: Terminal, notes: Notebook) -> Operator:
    return Operator(terminal, PARAMETERS, notes, EmergencyStop(lambda: None), terminal.read_line)


def judged_by(terminal: Terminal, outcome: EpisodeOutcome) -> list[Verdict]:
    notes = Notebook()
    operator_at(terminal, notes).episode_ends(12, "chair", 4, outcome)
    assert not terminal.answers
    assert terminal.ended == [12]
    return notes.verdicts


def stopped(distance_m: float = 1.4) -> EpisodeOutcome:
    distance = GoalDistance(distance_m, PoseSource.ESTIMATED, "office-chair")
    return EpisodeOutcome(judge(EndReason.STOP, 31, distance, PARAMETERS), 31, None, 60.0)


def test_the_starting_position_is_named_and_enter_waited_for() -> None:
    terminal = Terminal("")
    notes = Notebook()
    operator_at(terminal, notes).put_at(START, "")
    assert "starting position 4: x 2.50 m, y 1.25 m, facing 90° (by the sofa)" in terminal.text
    assert "not yet" not in terminal.text
    assert notes.interventions == [], "placing the robot is the protocol's"


def test_what_was_wrong_is_said_when_asking_again() -> None:
    terminal = Terminal("")
    operator_at(terminal, Notebook()).put_at(START, "the base still reports: wheel drop")
    assert "not yet: the base still reports: wheel drop" in terminal.text


def test_a_measured_distance_overrides_the_estimate() -> None:
    (verdict,) = judged_by(Terminal("", "0,84 m"), stopped(1.4))
    assert verdict.success is True
    assert verdict.distance == GoalDistance(0.84, PoseSource.TAPE, "office-chair")


def test_enter_keeps_the_estimate_and_adds_no_verdict() -> None:
    assert judged_by(Terminal("", ""), stopped(0.7)) == []


def test_a_distance_that_is_none_is_asked_for_again() -> None:
    terminal = Terminal("", "near", "-1", "nan", "1.2")
    (verdict,) = judged_by(terminal, stopped(0.7))
    assert verdict.success is False
    assert len(terminal.questions) == 5


def test_a_collision_that_only_a_person_saw_fails_the_episode() -> None:
    (verdict,) = judged_by(Terminal("the table's leg"), stopped(0.5))
    assert verdict.end_reason is EndReason.COLLISION
    assert verdict.success is False
    assert "the table's leg (seen by a person)" in verdict.text


def test_after_the_cap_only_collisions_are_asked_for() -> None:
    outcome = EpisodeOutcome(judge(EndReason.STEP_LIMIT, 150, None, PARAMETERS), 150, None, 60.0)
    assert judged_by(Terminal("no"), outcome) == []


@pytest.mark.parametrize("reason", [EndReason.COLLISION, EndReason.SENSOR_LOST, EndReason.ABORTED])
def test_nothing_is_asked_where_the_answer_could_change_nothing(reason) -> None:
    outcome = EpisodeOutcome(judge(reason, 9, None, PARAMETERS), 9, None, 60.0)
    assert judged_by(Terminal(), outcome) == []


def test_a_run_without_a_terminal_is_refused_unless_it_is_unattended(monkeypatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO())
    profile = load_profile("turtlebot2")
    with pytest.raises(UsageError, match="--unattended"):
        require_operator(profile, unattended=False)
    require_operator(profile, unattended=True)


def test_where_nobody_is_a_problem_cannot_be_put_right() -> None:
    Absent().put_at(START, "")
    with pytest.raises(RobotError, match="wheel drop, and the run is unattended"):
        Absent().put_at(START, "the base still reports: wheel drop")


@pytest.mark.parametrize("reason", [EndReason.MOTION_FAILED, EndReason.SENSOR_LOST])
def test_fetching_the_robot_from_a_failure_is_noted_once_with_the_episode_that_failed(reason) -> None:
    terminal, notes = Terminal("", "", ""), Notebook()
    operator = operator_at(terminal, notes)
    operator.episode_ends(12, "chair", 4, EpisodeOutcome(judge(reason, 9, None, PARAMETERS), 9, None, 60.0))
    assert notes.interventions == [], "nobody has touched it yet"
    operator.put_at(START, "")
    operator.put_at(START, "it is 0.4 m off")
    assert notes.interventions == [(12, 9, f"moved by hand after {reason.value}")]


def test_a_collision_that_a_person_calls_is_noted_and_a_measured_distance_is_not() -> None:
    notes = Notebook()
    operator_at(Terminal("", "1.2"), notes).episode_ends(11, "chair", 4, stopped(0.7))
    assert len(notes.verdicts) == 1
    assert notes.interventions == []
    operator_at(Terminal("the table's leg"), notes).episode_ends(12, "chair", 4, stopped(0.5))
    ((episode, step, words),) = notes.interventions
    assert (episode, step) == (12, 31)
    assert "the table's leg" in words
