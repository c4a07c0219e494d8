"""Whatever a policy does, it is the policy's own failure, in one line; only a request to stop passes."""

import os
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from tests.runner.stand_ins import NOBODY, PLAN, PROFILE, ScriptedPolicy, StandInRobot
from tests.runner.test_episode import MemoryRecorder
from vsnbench.models.contract import ModelCard
from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Decision, Diagnostics
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.runner.episode import EpisodeOutcome, run_episode
from vsnbench.runner.policy_calls import PolicyCalls, PolicyFailedError
from vsnbench.runner.stopping import Stopped, Stopping, of_signal

NEVER = StandInRobot().observe()


class UnreadableError(Exception):
    def __str__(self) -> str:
        raise RuntimeError("no words")


@dataclass
class Answering:
    """A policy whose answer is computed by the test."""

    answer: Callable[[Observation], Any]
    card: ModelCard = field(default_factory=lambda: ModelCard("answering", sensors=frozenset({Sensor.DEPTH})))

    def reset(self, goal: str, seed: int) -> None:
        pass

    def act(self, observation: Observation) -> Decision:
        return self.answer(observation)  # type: ignore[no-any-return]


def run(policy: Answering, robot: StandInRobot, recorder: MemoryRecorder) -> EpisodeOutcome:
    with Stopping() as stop:
        return run_episode(robot, policy, PLAN, recorder, NOBODY, stop)


def fail_with(failure: BaseException) -> Callable[[Observation], Any]:
    def fail(_observation: Observation) -> Any:
        raise failure

    return fail


def cyclic(_observation: Observation) -> Decision:
    loop: dict[str, Any] = {}
    loop["again"] = loop
    return Decision(Action.STOP, diagnostics=Diagnostics(details=loop))


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (fail_with(ValueError("bad\nnews")), "act: ValueError: bad news"),
        (fail_with(SystemExit("bad  news")), "act: SystemExit: bad news"),
        (fail_with(KeyboardInterrupt()), "act: KeyboardInterrupt"),
        (fail_with(GeneratorExit()), "act: GeneratorExit"),
        (fail_with(UnreadableError()), "act: UnreadableError: (its message cannot be read: RuntimeError)"),
        (
            lambda _observation: "forward",
            (
                "act: not a decision that can be carried out and recorded: it is no Decision but a str: "
                "return Decision(Action.MOVE_FORWARD), for example"
            ),
        ),
        (
            cyclic,
            (
                "act: not a decision that can be carried out and recorded: "
                "details are nested more than 32 deep, or contain themselves"
            ),
        ),
        (
            lambda observation: Decision(Action.STOP, str(observation.rgb.mean())),
            (
                "act: SensorNotDeclaredError: observation.rgb is not shown to this model, because its card does not "
                "name rgb: add Sensor.RGB to the card's sensors"
            ),
        ),
    ],
)
def test_whatever_a_policy_does_wrong_voids_the_episode_as_the_models_error(
    answer: Callable[[Observation], Any], words: str
) -> None:
    robot, recorder = StandInRobot(), MemoryRecorder()
    outcome = run(Answering(answer), robot, recorder)
    assert outcome.verdict.end_reason is EndReason.MODEL_ERROR
    assert outcome.verdict.success is None
    assert outcome.error == words
    assert recorder.outcome is outcome
    assert robot.halts


def test_a_policy_that_exits_in_reset_fails_as_one_that_exits_in_act() -> None:
    class Leaving(ScriptedPolicy):
        def reset(self, goal: str, seed: int) -> None:
            raise SystemExit("bye")

    with pytest.raises(PolicyFailedError, match="reset: SystemExit: bye"):
        PolicyCalls(Leaving([]), Stopping()).reset(
            PLAN.site, PLAN.goal, PLAN.start.pose, PROFILE.base, 7, PLAN.parameters
        )


def test_a_request_to_stop_that_interrupts_a_policy_is_not_the_policys_failure() -> None:
    with pytest.raises(Stopped):
        PolicyCalls(Answering(fail_with(Stopped(of_signal(15)))), Stopping()).act(NEVER)


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
def test_a_request_to_stop_that_a_policy_swallows_still_stops_before_the_robot_moves(
    then: Callable[[], Decision],
) -> None:
    robot, recorder = StandInRobot(), MemoryRecorder()
    with pytest.raises(Stopped):
        run(Answering(swallow(then)), robot, recorder)
    assert robot.executed == []
    assert recorder.outcome is not None
    assert recorder.outcome.verdict.end_reason is EndReason.ABORTED


def test_a_policy_that_spoils_its_depth_image_does_not_switch_the_depth_guard_off() -> None:
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


def test_a_thread_of_a_policy_does_not_change_the_record_later() -> None:
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


def test_a_card_that_grows_during_the_episode_shows_no_more() -> None:
    policy = Answering(lambda _observation: Decision(Action.TURN_LEFT))
    calls = PolicyCalls(policy, Stopping())
    policy.card = ModelCard("answering", sensors=frozenset(Sensor))
    policy.answer = lambda observation: Decision(Action.STOP, str(observation.pose))
    with pytest.raises(PolicyFailedError, match=r"add Sensor\.ODOMETRY"):
        calls.act(NEVER)
