"""The progress bar at the terminal shows the remaining limits of the protocol."""

from dataclasses import replace

import pytest

from tests.runner.episode.test_episode import MemoryRecorder
from tests.runner.episode.test_limits import Mover
from tests.runner.stand_ins import PLAN, ScriptedPolicy
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.step import Step
from vsnbench.runner.operator.contract import AbsentOperator, TrialCounts
from vsnbench.runner.operator.progress import ProgressDisplay
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.values.movement import Action


@pytest.mark.parametrize(
    ("limits", "last"),
    [
        ({}, "chair from 1: 2/2 turn left"),
        ({"max_time_s": 60}, "chair from 1: 2/2 56 s left turn left"),
        ({"max_path_m": 3}, "chair from 1: 2/2 2.5 m left turn left"),
        ({"max_time_s": 60, "max_path_m": 3}, "chair from 1: 2/2 56 s left 2.5 m left turn left"),
    ],
)
def test_the_bar_shows_the_time_and_the_path_that_are_left(limits: dict[str, float], last: str) -> None:
    parameters = ProtocolParameters.model_validate({"max_actions": 2, **limits})
    shown: list[str] = []

    class Kept(ProgressDisplay):
        def step(self, goal: str, start: int, step: Step) -> None:
            super().step(goal, start, step)
            shown.append(self._bar.tasks[0].fields["now"])

    recorder, plan = MemoryRecorder(), replace(PLAN, parameters=parameters)
    with StopRequests() as stop, Kept("stand-in", TrialCounts(1), parameters) as progress:
        policy = ScriptedPolicy([Action.TURN_LEFT])
        run_episode(Mover(), policy, plan, recorder, AbsentOperator(progress), stop)
    assert len(shown) == 2
    assert shown[-1] == last
