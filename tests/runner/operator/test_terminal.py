"""The operator at the terminal: questions, confirmations and verdicts."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest
from rich.console import Console

from tests.runner.stand_ins import APARTMENT, PLAN, StandInRobot
from vsnbench.errors import UsageError
from vsnbench.protocol.judge import EndReason, GoalDistance, judge
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.robots.profiles import load_profile
from vsnbench.runner.operator.contract import Display, EndedEpisode, Judgement
from vsnbench.runner.operator.placing import Placing
from vsnbench.runner.operator.prompts import OperatorPrompts
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.operator.terminal import TerminalOperator
from vsnbench.runner.stopping.emergency_key import EmergencyStop
from vsnbench.runner.stopping.requests import Stopped, StopRequests
from vsnbench.sites.site import StartingPosition
from vsnbench.values.fix import PoseSource
from vsnbench.values.observation import Sensor

START = StartingPosition(number=4, position=(2.5, 1.25), heading_deg=90, note="by the sofa")
PARAMETERS = ProtocolParameters()
PLAN_OF_31 = replace(PLAN, parameters=PARAMETERS)


class Terminal(Display):
    """A display that keeps its output, and a person with scripted answers."""

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


def operator_at(terminal: Terminal, *, has_page: bool = False) -> TerminalOperator:
    stop, prompts = StopRequests(), OperatorPrompts()
    prompts.read_line = terminal.read_line
    return TerminalOperator(terminal, EmergencyStop(lambda: None, stop.ask), stop, prompts, has_page=has_page)


def placing_blind() -> Placing:
    """Placement of a robot without a depth camera."""
    return Placing(StandInRobot(sensors=frozenset({Sensor.RGB})), APARTMENT, START, 0, PARAMETERS, StopRequests())


def judged_by(terminal: Terminal, outcome: EpisodeEnd) -> Judgement | None:
    judgement = operator_at(terminal).judge(EndedEpisode(12, PLAN_OF_31, outcome))
    assert not terminal.answers
    return judgement


def stopped(distance_m: float = 1.4) -> EpisodeEnd:
    distance = GoalDistance(distance_m, PoseSource.ESTIMATED, "office-chair")
    return EpisodeEnd(judge(EndReason.STOP, 31, distance, PARAMETERS), 31, None, 60.0, proposed=True)


def ended(reason: EndReason, actions: int) -> EpisodeEnd:
    return EpisodeEnd(judge(reason, actions, None, PARAMETERS), actions, None, 60.0, proposed=True)


def test_the_starting_position_is_shown_until_enter() -> None:
    terminal = Terminal("")
    operator_at(terminal).place(START, "", placing_blind())
    assert "starting position 4: x 2.50 m, y 1.25 m, facing 90° (by the sofa)" in terminal.text
    assert "not yet" not in terminal.text
    assert "the space bar stops the robot and ends this episode" in terminal.text


def test_a_second_placement_shows_the_problem() -> None:
    terminal = Terminal("")
    operator_at(terminal).place(START, "the base still reports: wheel drop", placing_blind())
    assert "not yet: the base still reports: wheel drop" in terminal.text


def test_a_measured_distance_overrides_the_estimate() -> None:
    judgement = judged_by(Terminal("nothing", "0,84 m", "yes"), stopped(1.4))
    assert judgement is not None
    assert judgement.verdict.success is True
    assert judgement.verdict.distance == GoalDistance(0.84, PoseSource.TAPE, "office-chair")
    assert not judgement.called_collision


def test_enter_alone_is_not_a_verdict() -> None:
    terminal = Terminal("", "", "no", "", "keep")
    judgement = judged_by(terminal, stopped(0.7))
    assert judgement is not None
    assert judgement.verdict == stopped(0.7).verdict
    assert terminal.text.count("Did it touch anything?") == 3


def test_an_invalid_distance_is_asked_again() -> None:
    judgement = judged_by(Terminal("no", "near", "-1", "84", "nan", "1.2", "yes"), stopped(0.7))
    assert judgement is not None
    assert judgement.verdict.success is False


def test_a_distance_far_from_the_estimate_must_be_confirmed() -> None:
    terminal = Terminal("no", "8.4", "no", "0.84")
    judgement = judged_by(terminal, stopped(0.7))
    assert judgement is not None
    assert judgement.verdict.success is True
    assert "measured 8.40 m, estimated 0.70 m: changes success to failure. Is that right?" in terminal.text


def test_a_collision_seen_by_the_operator_fails_the_episode_once_confirmed() -> None:
    judgement = judged_by(Terminal("the table's leg", "yes"), stopped(0.5))
    assert judgement is not None
    assert (judgement.verdict.end_reason, judgement.verdict.success) == (EndReason.COLLISION, False)
    assert "the table's leg (seen by a person)" in judgement.verdict.text
    assert judgement.called_collision


def test_a_typing_error_is_not_a_collision() -> None:
    judgement = judged_by(Terminal("nb", "no", "no", "keep"), stopped(0.5))
    assert judgement is not None
    assert judgement.verdict.success is True


@pytest.mark.parametrize("answers", [("later",), ("no", "later")])
def test_later_leaves_the_episode_awaiting_judgement(answers: tuple[str, ...]) -> None:
    terminal = Terminal(*answers)
    assert judged_by(terminal, stopped()) is None
    assert "#12 awaits judgement: vsnbench judge 12" in terminal.text


def test_after_the_action_limit_only_collisions_are_asked() -> None:
    judgement = judged_by(Terminal("no"), ended(EndReason.STEP_LIMIT, 150))
    assert judgement is not None
    assert judgement.verdict == ended(EndReason.STEP_LIMIT, 150).verdict


def test_a_felt_collision_needs_only_a_yes() -> None:
    judgement = judged_by(Terminal("", "yes"), ended(EndReason.COLLISION, 9))
    assert judgement is not None
    assert judgement.verdict.success is False
    assert not judgement.called_collision
    assert judged_by(Terminal("later"), ended(EndReason.COLLISION, 9)) is None


@pytest.mark.parametrize("answers", [(), ("no",)])
def test_a_closed_terminal_does_not_judge(answers: tuple[str, ...]) -> None:
    with pytest.raises(Stopped, match="a terminal that was closed"):
        judged_by(Terminal(*answers), stopped())


def test_a_question_where_the_robot_is_belongs_to_one_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    operator, said = operator_at(Terminal()), list[str]()
    prompts = operator._prompts
    monkeypatch.setattr(operator._display, "say", said.append, raising=False)
    prompts.driving = True
    prompts.ask_where()
    assert operator.asks_where(can_measure=True)
    prompts.ask_where()
    assert not operator.asks_where(can_measure=False)
    assert "depth camera" in said[0]
    prompts.ask_where()
    operator.episode_ended(EndedEpisode(12, PLAN_OF_31, stopped()))
    assert not operator.asks_where(can_measure=True), "it came after the last action"


def test_void_trials_run_again_in_the_session_only_with_a_page() -> None:
    assert operator_at(Terminal(), has_page=True).repeats_void_trials
    assert not operator_at(Terminal()).repeats_void_trials


def test_a_run_without_a_terminal_is_refused_unless_unattended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO())
    profile = load_profile("turtlebot2")
    with pytest.raises(UsageError) as refused:
        OperatorProvider().require(profile)
    assert refused.value.code == "no-operator"
    OperatorProvider(unattended=True).require(profile)
