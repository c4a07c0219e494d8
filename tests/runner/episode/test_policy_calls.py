"""Every failure of a policy is recorded as the model's error in one line; requests to stop are not."""

import contextlib
import ctypes
import os
import platform
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.runner.episode.test_episode import MemoryRecorder
from tests.runner.stand_ins import NOBODY, PLAN, PROFILE, ScriptedPolicy, StandInRobot
from vsnbench.errors import EpisodeClosedError, ModelError, ModelLostError, RecordError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.process_exit import process_exit_refused
from vsnbench.models.task import task_of
from vsnbench.protocol.judge import EndReason
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.policy_calls import PolicyCalls, PolicyFailedError
from vsnbench.runner.stopping.requests import Stopped, StopRequests, of_signal
from vsnbench.text.sanitize import LONGEST_LINE
from vsnbench.values.decision import Decision, Diagnostics
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor

UPWARD = {"x86_64": 0x800, "aarch64": 0x400000}[platform.machine()]
"""FE_UPWARD of C's fenv.h."""
NEVER = StandInRobot().observe()


class UnreadableError(Exception):
    def __str__(self) -> str:
        raise RuntimeError("no words")


@dataclass
class Answering(Policy):
    """A policy whose answer is computed by the test."""

    answer: Callable[[Observation], Any]
    card: ModelCard = field(default_factory=lambda: ModelCard("answering", sensors=frozenset({Sensor.DEPTH})))

    def reset(self, goal: str, seed: int) -> None:
        pass

    def act(self, observation: Observation) -> Decision:
        return self.answer(observation)  # type: ignore[no-any-return]


def run(policy: Answering, robot: StandInRobot, recorder: MemoryRecorder) -> EpisodeEnd:
    with StopRequests() as stop, process_exit_refused():
        return run_episode(robot, policy, PLAN, recorder, NOBODY, stop)


def fail_with(failure: BaseException) -> Callable[[Observation], Any]:
    def fail(_observation: Observation) -> Any:
        raise failure

    return fail


def cyclic(_observation: Observation) -> Decision:
    loop: dict[str, Any] = {}
    loop["again"] = loop
    return Decision(Action.STOP, diagnostics=Diagnostics(details=loop))


def exit_quietly(_observation: Observation) -> Decision:
    with contextlib.suppress(BaseException):
        os._exit(5)
    return Decision(Action.STOP)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (fail_with(ValueError("bad\nnews")), "act: ValueError: bad news"),
        (fail_with(SystemExit("bad  news")), "act: SystemExit: bad news"),
        (fail_with(KeyboardInterrupt()), "act: KeyboardInterrupt"),
        (fail_with(GeneratorExit()), "act: GeneratorExit"),
        (fail_with(UnreadableError()), "act: UnreadableError: (its message cannot be read: RuntimeError)"),
        (fail_with(Stopped(of_signal(2))), "act: Stopped: stopped with Ctrl-C"),
        (fail_with(RecordError("disk full")), "act: RecordError: disk full"),
        (fail_with(EpisodeClosedError("over")), "act: EpisodeClosedError: over"),
        (lambda _observation: os._exit(0), "act: the model called os._exit(0), which would end the whole run"),
        (exit_quietly, "act: the model called os._exit(5), which would end the whole run"),
        (
            lambda _observation: "forward",
            (
                "act: not a decision that can be carried out and recorded: expected a Decision, got a str: "
                "return Decision(Action.MOVE_FORWARD), for example"
            ),
        ),
        (
            cyclic,
            (
                "act: not a decision that can be carried out and recorded: "
                "details must be nested at most 32 deep and not contain themselves"
            ),
        ),
        (
            lambda observation: Decision(Action.STOP, str(observation.rgb.mean())),
            (
                "act: SensorNotDeclaredError: observation.rgb is not available: rgb is not on the model's card; "
                "add Sensor.RGB to the card's sensors"
            ),
        ),
    ],
)
def test_every_failure_of_a_policy_is_a_model_error(answer: Callable[[Observation], Any], words: str) -> None:
    robot, recorder = StandInRobot(), MemoryRecorder()
    outcome = run(Answering(answer), robot, recorder)
    assert outcome.verdict.end_reason is EndReason.MODEL_ERROR
    assert outcome.verdict.success is None
    assert outcome.error == words
    assert recorder.outcome is outcome
    assert robot.halts


class UnreadableLossError(ModelLostError):
    def __str__(self) -> str:
        raise RuntimeError("unreadable")


@pytest.mark.parametrize(
    ("loss", "begin"),
    [(ModelLostError("\x1b[2J" * 2_000_000), r"\x1b[2J\x1b[2J"), (UnreadableLossError("x"), "(its message cannot be")],
)
def test_a_lost_model_leaves_one_bounded_printable_line(loss: ModelLostError, begin: str) -> None:
    outcome = run(Answering(fail_with(loss)), StandInRobot(), MemoryRecorder())
    assert outcome.verdict.end_reason is EndReason.MODEL_LOST
    assert outcome.error.startswith(begin)
    assert len(outcome.error) <= LONGEST_LINE
    assert outcome.error.isprintable()


@pytest.mark.parametrize("fails", [False, True])
def test_a_policy_does_not_change_how_later_results_are_rounded(fails: bool) -> None:
    mathematics = ctypes.CDLL(None)
    usual = mathematics.fegetround()
    modes = []

    def answer(_: Observation) -> Action:
        assert mathematics.fesetround(UPWARD) == 0
        modes.append(mathematics.fegetround())
        if fails:
            raise RuntimeError("no")
        return Action.STOP

    run(Answering(answer), StandInRobot(), MemoryRecorder())
    assert modes == [UPWARD]
    assert mathematics.fegetround() == usual


def logged(caplog: pytest.LogCaptureFixture, level: str) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelname == level]


def test_a_failure_is_one_line_with_its_place_and_the_traceback_is_for_who_wants_more(
    caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    file = tmp_path / "mine.py"
    file.write_text("def act(observation):\n    return {}['layer']\n")
    names: dict[str, Callable[[Observation], Action]] = {}
    exec(compile(file.read_text(), file, "exec"), names)
    run(Answering(names["act"]), StandInRobot(), MemoryRecorder())
    assert caplog.messages == ["model answering failed in act: KeyError: 'layer' (mine.py, line 2)"]
    caplog.clear()
    with caplog.at_level("INFO", "vsnbench"):
        run(Answering(names["act"]), StandInRobot(), MemoryRecorder())
    assert logged(caplog, "ERROR") == ["model answering failed in act: KeyError: 'layer' (mine.py, line 2)"]
    (more,) = logged(caplog, "INFO")
    assert "return {}['layer']" in more
    assert "fitting_decision" not in more, "no frames of the caller"


def test_a_mistyped_action_is_suggested(caplog: pytest.LogCaptureFixture) -> None:
    run(Answering(lambda _: Action.MOVE_FOWARD), StandInRobot(), MemoryRecorder())  # type: ignore[attr-defined]
    (line,) = caplog.messages
    assert "MOVE_FOWARD: did you mean MOVE_FORWARD? (test_policy_calls.py, line " in line


def test_a_stated_failure_is_logged_with_the_models_frames_and_not_ours(caplog: pytest.LogCaptureFixture) -> None:
    failure = ModelError("sent an invalid message")
    failure.add_note("In the model's own process:\nnet.py, line 7")
    with caplog.at_level("INFO", "vsnbench"):
        run(Answering(fail_with(failure)), StandInRobot(), MemoryRecorder())
    assert logged(caplog, "ERROR") == ["model answering failed in act: sent an invalid message"]
    assert logged(caplog, "INFO") == ["model answering in act:\nIn the model's own process:\nnet.py, line 7"]


def test_want_of_memory_is_one_line_with_its_remedy_and_not_a_traceback(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", "vsnbench"):
        outcome = run(Answering(fail_with(MemoryError("4 GiB"))), StandInRobot(), MemoryRecorder())
    assert outcome.error.startswith("act: there is not enough memory; ")
    assert outcome.error.endswith("(MemoryError: 4 GiB)")
    assert caplog.messages == [f"model answering failed in {outcome.error}"]


def test_an_exit_in_reset_is_a_model_error() -> None:
    class Leaving(ScriptedPolicy):
        def reset(self, goal: str, seed: int) -> None:
            raise SystemExit("bye")

    with pytest.raises(PolicyFailedError, match="reset: SystemExit: bye"):
        PolicyCalls(Leaving([]), StopRequests()).begin(
            PLAN.site,
            PLAN.start.pose,
            task_of(PLAN.goal, 7, PLAN.parameters, PROFILE),
            PLAN.parameters,
            PROFILE.base,
        )


def test_a_request_to_stop_is_not_a_failure_of_the_policy() -> None:
    stop = StopRequests()
    stop.ask(of_signal(15))
    with pytest.raises(Stopped):
        PolicyCalls(Answering(fail_with(ValueError())), stop).act(NEVER)


class EndlessError(Exception):
    def __str__(self) -> str:
        while True:
            threading.Event().wait(0.01)
        return ""


def test_an_error_whose_text_hangs_is_recorded_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vsnbench.text.sanitize.TEXT_TIMEOUT_S", 0.1)
    monkeypatch.setattr("vsnbench.runner.episode.policy_calls.TRACEBACK_TIMEOUT_S", 0.1)
    outcome = run(Answering(fail_with(EndlessError())), StandInRobot(), MemoryRecorder())
    assert outcome.error == "act: EndlessError: (its message takes too long)"


def test_a_traceback_is_sanitized(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", "vsnbench"):
        run(Answering(fail_with(ValueError("\x1b[31mred"))), StandInRobot(), MemoryRecorder())
    assert all("\\x1b[31mred" in text and "\x1b" not in text for text in caplog.messages)
    assert len(caplog.messages) == 2


def swallow(then: Callable[[], Decision]) -> Callable[[Observation], Decision]:
    def act(_observation: Observation) -> Decision:
        try:
            os.kill(os.getpid(), signal.SIGINT)
            threading.Event().wait(10)
        except BaseException:
            return then()
        raise AssertionError("no signal came")

    return act


def refuse() -> Decision:
    raise ValueError("interrupted?")


@pytest.mark.parametrize("then", [lambda: Decision(Action.MOVE_FORWARD), refuse])
def test_a_stop_that_a_policy_catches_still_stops_before_the_robot_moves(
    then: Callable[[], Decision],
) -> None:
    robot, recorder = StandInRobot(), MemoryRecorder()
    with pytest.raises(Stopped):
        run(Answering(swallow(then)), robot, recorder)
    assert robot.executed == []
    assert recorder.outcome is not None
    assert recorder.outcome.verdict.end_reason is EndReason.ABORTED


def test_a_policy_cannot_edit_the_depth_image_of_the_guard() -> None:
    def spoil(observation: Observation) -> Decision:
        assert observation.depth_m is not None
        observation.depth_m.flags.writeable = True
        np.nan_to_num(observation.depth_m, copy=False, nan=10)
        observation.depth_m[:] = 10.0
        return Decision(Action.MOVE_FORWARD)

    robot, recorder = StandInRobot(depth_m=0.3), MemoryRecorder()
    run(Answering(spoil), robot, recorder)
    assert robot.executed == []
    assert all(step.blocked for step in recorder.steps)


def test_a_thread_of_a_policy_cannot_edit_the_record() -> None:
    kept: list[Observation] = []
    threads: list[threading.Thread] = []
    answers: list[dict[str, Any]] = []

    def blacken() -> None:
        for observation, details in zip(kept, answers, strict=True):
            assert observation.depth_m is not None
            observation.depth_m.flags.writeable = True
            observation.depth_m[:] = 0
            details["seen"] = "nothing"

    def answer(observation: Observation) -> Decision:
        kept.append(observation)
        answers.append({"seen": "sofa"})
        return Decision(Action.STOP, diagnostics=Diagnostics(details=answers[-1]))

    recorder = MemoryRecorder()
    run(Answering(answer), StandInRobot(), recorder)
    threads.append(threading.Thread(target=blacken))
    threads[0].start()
    threads[0].join()
    step = recorder.steps[0]
    assert step.observation.depth_m is not None
    assert step.observation.depth_m.min() == 3.0
    assert step.decision.diagnostics.details == {"seen": "sofa"}


def test_a_card_edited_during_the_episode_has_no_effect() -> None:
    policy = Answering(lambda _observation: Decision(Action.TURN_LEFT))
    calls = PolicyCalls(policy, StopRequests())
    policy.card = ModelCard("answering", sensors=frozenset(Sensor))
    policy.answer = lambda observation: Decision(Action.STOP, str(observation.pose))
    with pytest.raises(PolicyFailedError, match=r"add Sensor\.ODOMETRY"):
        calls.act(NEVER)
