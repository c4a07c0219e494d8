"""Measures what latency costs a robot that drives on while the model thinks, in simulation.

`oracle-waypoints` searches a goal from every starting position of the apartment, with the robot at rest while the model
thinks and at several declared latencies. At rest, the time of a trial is that of the movements plus the latency of each
answer. Nothing is recorded, and the camera has 160 x 120 pixels, which changes no motion of this model unless the depth
guard stops it.

    python benchmarks/continuous_latency.py --goal chair --latency 0 0.3 1 3
"""

import argparse
import sys
from dataclasses import dataclass, field
from pathlib import Path
from statistics import mean

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from vsnbench.models.loaded import LoadedPolicy
from vsnbench.models.registry import create_policy
from vsnbench.protocol.execution import Execution
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.robots.registry import open_robot
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.operator.contract import AbsentOperator
from vsnbench.runner.operator.placing import PlacementLook
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.sites.site import load_site
from vsnbench.values.fix import Fix
from vsnbench.values.observation import Sensor


@dataclass
class Sums:
    """What one episode took."""

    steps: list[Step] = field(default_factory=list)
    success: bool = False

    @property
    def duration_s(self) -> float:
        """Time on the robot's clock."""
        return sum(step.result.duration_s for step in self.steps if step.result)

    @property
    def waiting_s(self) -> float:
        """Time at rest, waiting for an answer."""
        return sum(step.result.waiting_s or 0.0 for step in self.steps if step.result)

    @property
    def path_m(self) -> float:
        """Length of the driven path."""
        ways = (step.result for step in self.steps if step.result)
        return sum(abs(way.displacement_m) if way.path_m is None else way.path_m for way in ways)

    def kept_photo(self, plan: EpisodePlan) -> bytes | None:
        """Return None: there is no placement."""

    def begin(self, plan: EpisodePlan, start: Fix, placed: PlacementLook | None = None) -> None:
        """Accept the begin."""

    def step(self, step: Step) -> None:
        """Keep a step."""
        self.steps.append(step)

    def event(self, kind: str, text: str) -> None:
        """Ignore events."""

    def intervention(self, what: str, author: str = "") -> None:
        """Ignore interventions."""

    def end(self, outcome: EpisodeEnd) -> None:
        """Keep the verdict."""
        self.success = outcome.verdict.success is True


def episodes_of(goal: str, latency_s: float | None) -> list[Sums]:
    """Run a trial from every starting position; None is a robot at rest while the model thinks."""
    site, parameters = load_site("apartment"), ProtocolParameters()
    if latency_s is not None:
        parameters = parameters.executed(Execution(latency_s=latency_s))
    policy = LoadedPolicy(create_policy("oracle-waypoints"))
    episodes = []
    with open_robot("simulated:turtlebot2@160x120", site, parameters, read=frozenset({Sensor.DEPTH})) as robot:
        for start in site.starts:
            episodes.append(Sums())
            plan = EpisodePlan(site, goal, start, 7, parameters)
            run_episode(robot, policy, plan, episodes[-1], AbsentOperator(), StopRequests())
    return episodes


def print_row(name: str, episodes: list[Sums], thinking_s: float) -> None:
    """Print means over the starting positions; `thinking_s` is added to the time of a trial for each answer."""
    answers = [len(episode.steps) for episode in episodes]
    times_s = [episode.duration_s + thinking_s * count for episode, count in zip(episodes, answers, strict=True)]
    print(
        f"| {name} | {sum(episode.success for episode in episodes)}/{len(episodes)} | {mean(times_s):.1f} | "
        f"{mean(episode.waiting_s for episode in episodes):.1f} | {mean(answers):.1f} | "
        f"{mean(episode.path_m for episode in episodes):.2f} | "
        f"{sum(step.blocked for episode in episodes for step in episode.steps)} |",
        flush=True,
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--goal", default="chair")
    parser.add_argument("--latency", type=float, nargs="+", default=[0.0, 0.3, 1.0, 3.0])
    given = parser.parse_args()
    print("| execution, latency | SR | time (s) | waiting (s) | answers | path (m) | blocked stops |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    resting = episodes_of(given.goal, None)
    for seconds in given.latency:
        print_row(f"stop_and_go, {seconds:g} s", resting, seconds)
        print_row(f"continuous, {seconds:g} s", episodes_of(given.goal, seconds), 0.0)
