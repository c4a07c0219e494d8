"""A robot with a faulty camera, a model that turns only after refusals, and counts of the results."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from tests.runner.stand_ins import NOBODY
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.robots.contract import Robot
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.values.decision import Decision
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose

FAULTS = ("right", "nan", "frozen", "frozen colour", "left half", "millimetres", "holes", "minimum range")
MINIMUM_RANGE_M = 0.6
NODE = Path(__file__).parent / "nodes" / "faulty_robot.py"
BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "blind_camera.py"


@dataclass(frozen=True, slots=True)
class Ending:
    """Expected effect of a fault of the camera over ROS."""

    moves: int
    """Number of movements that may pass before it is detected."""
    says: str
    """Part of the reason of the episode's end."""


ENDINGS = {
    "nan": Ending(0, "the depth camera stays blind"),
    "frozen": Ending(1, "the depth image has not changed"),
    "frozen colour": Ending(1, "the colour image has not changed"),
    "left half": Ending(12, "the left half of the depth image is always invalid"),
    "millimetres": Ending(0, "32FC1 is in metres"),
    "ahead": Ending(0, "s ahead of the odometry"),
}


class FaultyRobot(SimulatedRobot):
    """The simulated robot with a depth camera that can be made faulty."""

    fault = "right"
    seed = 0

    def begin(self, start: StartingPosition, seed: int) -> None:
        """Begin with a camera without earlier images."""
        super().begin(start, seed)
        self._rng = np.random.default_rng(self.seed)
        self._frozen: np.ndarray | None = None
        self._frozen_rgb: np.ndarray | None = None

    def observe(self) -> Observation:
        """Return the camera's depth image."""
        seen = super().observe()
        assert seen.depth_m is not None
        depth_m = seen.depth_m
        invalid = np.float32(np.nan)
        if self.fault == "nan":
            depth_m = np.full_like(depth_m, invalid)
        elif self.fault == "frozen":
            self._frozen = depth_m if self._frozen is None else self._frozen
            depth_m = self._frozen.copy()
        elif self.fault == "frozen colour":
            self._frozen_rgb = seen.rgb if self._frozen_rgb is None else self._frozen_rgb
            seen = replace(seen, rgb=self._frozen_rgb.copy())
        elif self.fault == "left half":
            depth_m = depth_m.copy()
            depth_m[:, : depth_m.shape[1] // 2] = invalid
        elif self.fault == "millimetres":
            depth_m = depth_m * np.float32(1000)
        elif self.fault == "holes":
            depth_m = np.where(self._rng.random(depth_m.shape) < 0.5, invalid, depth_m)
        elif self.fault == "minimum range":
            depth_m = np.where(depth_m < MINIMUM_RANGE_M, invalid, depth_m)
        return replace(seen, depth_m=depth_m)


class ForwardOnly(Policy):
    """A model that chooses MOVE_FORWARD, and with `turns` TURN_LEFT where it has not moved since the last look."""

    card = ModelCard("forward only", sensors=frozenset({Sensor.ODOMETRY}))

    def __init__(self, *, turns: bool = False) -> None:
        self.turns = turns

    def reset(self, goal: str, seed: int) -> None:
        """Forget the last look."""
        self._before: Pose | None = None

    def act(self, observation: Observation) -> Decision:
        """Return the action."""
        before, self._before = self._before, observation.pose
        refused = before is not None and before.distance_to(observation.pose) < 0.01
        refused = refused and abs(before.heading_rad - observation.pose.heading_rad) < 0.02
        return Decision(Action.TURN_LEFT if self.turns and refused else Action.MOVE_FORWARD)


@dataclass
class Counts:
    """Counts of the episodes of a fault; also their recorder."""

    on_begin: Callable[[], None] = lambda: None
    actions: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    collisions: int = 0
    ends: Counter[str] = field(default_factory=Counter)
    words: str = ""

    def kept_photo(self, plan: EpisodePlan) -> None:
        """Return no photo."""

    def begin(self, *_: Any) -> None:
        """Call `on_begin`."""
        self.on_begin()

    def step(self, step: Step) -> None:
        """Count an action."""
        self.actions += 1
        if step.guard is not None and step.guard.refusal is not None:
            self.refused[step.guard.refusal.value] += 1
        if step.result is not None and step.result.collision is not None:
            self.collisions += 1

    def event(self, kind: str, text: str) -> None:
        """Store the reason of a sensor's loss."""
        if kind == "sensor_lost":
            self.words = text

    def intervention(self, *_: Any) -> None:
        """Do nothing."""

    def end(self, outcome: EpisodeEnd) -> None:
        """Count the end."""
        self.ends[outcome.verdict.end_reason.value] += 1

    @property
    def moves(self) -> int:
        """Number of movements that the guard let pass."""
        return self.actions - self.refused.total()

    def __iadd__(self, other: "Counts") -> Self:
        """Add the counts of other episodes."""
        self.actions += other.actions
        self.refused += other.refused
        self.collisions += other.collisions
        self.ends += other.ends
        self.words = other.words or self.words
        return self

    def numbers(self) -> dict[str, Any]:
        """Return the counts as JSON."""
        counted = {"moves": self.moves, "refused": dict(self.refused), "collisions": self.collisions}
        return counted | {"ends": dict(self.ends), "words": self.words}

    def __str__(self) -> str:
        refused = ", ".join(f"{count} {why}" for why, count in sorted(self.refused.items()))
        ends = ", ".join(f"{count} {why}" for why, count in sorted(self.ends.items()))
        return (
            f"{self.moves} moves, {self.refused.total()} refused ({refused}), "
            f"{self.collisions} collisions; ends: {ends}" + (f" ({self.words})" if self.words else "")
        )


def drive(
    robot: Robot,
    site: Site,
    starts: Iterable[int],
    actions: int,
    on_begin: Callable[[], None] = lambda: None,
    policy: Policy | None = None,
) -> Counts:
    """Run an episode from each start and count the results; call `on_begin` when the robot is placed."""
    counts, parameters = Counts(on_begin), ProtocolParameters(max_actions=actions)
    for number in starts:
        plan = EpisodePlan(site, "chair", site.start(number), 1, parameters)
        with StopRequests() as stop:
            run_episode(robot, policy or ForwardOnly(), plan, counts, NOBODY, stop)
    return counts
