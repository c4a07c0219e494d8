"""The person at the terminal: asked where it matters, believed over the odometry, and never judging by accident."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest
from rich.console import Console

from tests.runner.stand_ins import APARTMENT, PLAN, QuietDisplay, StandInRobot
from vsnbench.errors import UsageError
from vsnbench.protocol.fix import PoseSource
from vsnbench.protocol.judge import EndReason, GoalDistance, judge
from vsnbench.protocol.observation import Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import StartingPosition
from vsnbench.robots.profiles import load_profile
from vsnbench.runner.attendance import TerminalAttendance
from vsnbench.runner.attendant import EndedEpisode, Judgement, Upcoming
from vsnbench.runner.desk import Desk
from vsnbench.runner.emergency_stop import EmergencyStop
from vsnbench.runner.episode import EpisodeOutcome
from vsnbench.runner.operator import Beside, Operator
from vsnbench.runner.placing import Placing
from vsnbench.runner.session import TAKEN_AGAIN
from vsnbench.runner.stopping import Stopped, Stopping

START = StartingPosition(number=4, position=(2.5, 1.25), heading_deg=90, note="by the sofa")
PARAMETERS = ProtocolParameters()
PLAN_OF_31 = replace(PLAN, parameters=PARAMETERS)


class Terminal(QuietDisplay):
    """A display that keeps what is written, and a person whose answers are known beforehand."""

    def __init__(self, *answers: str) -> None:
        self.console = Console(file=io.StringIO(), width=300)
        self.answers = list(answers)

    @contextmanager
    def paused(self) -> Iterator[None]:
        yield

    def read_line(self) -> str:
        if not self.answers:
            raise EOFError
        return self.answers.pop(0)

    @property
    def text(self) -> str:
        return self.console.file.getvalue()


def operator_at(terminal: Terminal, beside: Beside | None = None) -> Operator:
    stop = Stopping()
    return Operator(terminal, EmergencyStop(lambda: None, stop.ask), stop, Desk(), beside, read_line=terminal.read_line)


def placing_blind() -> Placing:
    """The placing of a robot that has no depth camera to measure it with."""
    return Placing(StandInRobot(sensors=frozenset({Sensor.RGB})), APARTMENT, START, 0, PARAMETERS, Stopping())


def judged_by(terminal: Terminal, outcome: EpisodeOutcome) -> Judgement | None:
    judgement = operator_at(terminal).judge(EndedEpisode(12, PLAN_OF_31, outcome))
    assert not terminal.answers
    return judgement


def stopped(distance_m: float = 1.4) -> EpisodeOutcome:
    distance = GoalDistance(distance_m, PoseSource.ESTIMATED, "office-chair")
    return EpisodeOutcome(judge(EndReason.STOP, 31, distance, PARAMETERS), 31, None, 60.0, proposed=True)


def ended(reason: EndReason, actions: int) -> EpisodeOutcome:
    return EpisodeOutcome(judge(reason, actions, None, PARAMETERS), actions, None, 60.0, proposed=True)


def test_the_starting_position_is_named_and_enter_waited_for() -> None:
    terminal = Terminal("")
    operator_at(terminal).place(START, "", placing_blind())
    assert "starting position 4: x 2.50 m, y 1.25 m, facing 90° (by the sofa)" in terminal.text
    assert "not yet" not in terminal.text
    assert "the space bar stops the robot and ends this episode" in terminal.text


def test_what_was_wrong_is_said_when_asking_again() -> None:
    terminal = Terminal("")
    operator_at(terminal).place(START, "the base still reports: wheel drop", placing_blind())
    assert "not yet: the base still reports: wheel drop" in terminal.text


def test_a_measured_distance_overrides_the_estimate() -> None:
    judgement = judged_by(Terminal("nothing", "0,84 m"), stopped(1.4))
    assert judgement is not None
    assert judgement.verdict.success is True
    assert judgement.verdict.distance == GoalDistance(0.84, PoseSource.TAPE, "office-chair")
    assert not judgement.called_collision


def test_enter_alone_is_no_verdict() -> None:
    terminal = Terminal("", "", "no", "", "keep")
    judgement = judged_by(terminal, stopped(0.7))
    assert judgement is not None
    assert judgement.verdict == stopped(0.7).verdict
    assert terminal.text.count("Did it touch anything?") == 3


def test_a_distance_that_is_none_is_asked_for_again() -> None:
    judgement = judged_by(Terminal("no", "near", "-1", "84", "nan", "1.2"), stopped(0.7))
    assert judgement is not None
    assert judgement.verdict.success is False


def test_a_distance_far_from_the_estimate_is_asked_back() -> None:
    terminal = Terminal("no", "8.4", "no", "0.84")
    judgement = judged_by(terminal, stopped(0.7))
    assert judgement is not None
    assert judgement.verdict.success is True
    assert "8.40 m, and odometry says 0.70 m. Is that right?" in terminal.text


def test_a_collision_that_only_a_person_saw_fails_the_episode_once_it_is_confirmed() -> None:
    judgement = judged_by(Terminal("the table's leg", "yes"), stopped(0.5))
    assert judgement is not None
    assert (judgement.verdict.end_reason, judgement.verdict.success) == (EndReason.COLLISION, False)
    assert "the table's leg (seen by a person)" in judgement.verdict.text
    assert judgement.called_collision


def test_a_slip_of_the_fingers_is_no_collision() -> None:
    judgement = judged_by(Terminal("nb", "no", "no", "keep"), stopped(0.5))
    assert judgement is not None
    assert judgement.verdict.success is True


@pytest.mark.parametrize("answers", [("later",), ("no", "later")])
def test_whoever_is_not_sure_leaves_the_episode_awaiting_judgement(answers: tuple[str, ...]) -> None:
    terminal = Terminal(*answers)
    assert judged_by(terminal, stopped()) is None
    assert "#12 awaits judgement: vsnbench judge 12" in terminal.text


def test_after_the_cap_only_collisions_are_asked_for() -> None:
    judgement = judged_by(Terminal("no"), ended(EndReason.STEP_LIMIT, 150))
    assert judgement is not None
    assert judgement.verdict == ended(EndReason.STEP_LIMIT, 150).verdict


def test_a_collision_that_the_robot_felt_is_confirmed_in_a_word() -> None:
    judgement = judged_by(Terminal("", "yes"), ended(EndReason.COLLISION, 9))
    assert judgement is not None
    assert judgement.verdict.success is False
    assert not judgement.called_collision
    assert judged_by(Terminal("later"), ended(EndReason.COLLISION, 9)) is None


@pytest.mark.parametrize("answers", [(), ("no",)])
def test_a_terminal_that_is_closed_at_a_question_judges_nothing(answers: tuple[str, ...]) -> None:
    with pytest.raises(Stopped, match="a terminal that was closed"):
        judged_by(Terminal(*answers), stopped())


@pytest.mark.parametrize("reason", [one for one in EndReason if not one.is_result])
def test_what_robot_or_a_stop_made_void_comes_again_where_a_page_is_beside_and_what_the_model_did_does_not(
    reason: EndReason,
) -> None:
    void, comes = EndedEpisode(12, PLAN_OF_31, ended(reason, 4)), reason in TAKEN_AGAIN
    for by_page in (True, False):
        operator = operator_at(Terminal(), Beside(by_page=by_page))
        operator.trial_begins(Upcoming(12, 7, "scripted", PLAN_OF_31))
        operator.episode_ended(void)
        assert operator.again() == ([7] if comes and by_page else [])


def test_a_run_without_a_terminal_is_refused_unless_it_is_unattended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO())
    profile = load_profile("turtlebot2")
    with pytest.raises(UsageError, match="--unattended"):
        TerminalAttendance().require(profile)
    TerminalAttendance(unattended=True).require(profile)
