"""Runs episodes of the perturbed demonstrator or of a DAgger student, and stores each step."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from training.flat_world import SUCCESS_DISTANCE_M, FlatWorld, View
from training.recipe import Demonstrations
from training.shards import UNLABELLED, Shard, encode
from vsnbench.models.pirlnav.policy import ACTIONS, GOALS
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose

INDEX: Final = {action: number for number, action in enumerate(list(ACTIONS.values())[:4])}
"""Actions in demonstrations."""
_MOVES: Final = (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)


@dataclass(slots=True)
class Lane:
    """One running episode."""

    goal: str
    start: Pose
    pose: Pose
    previous: int = 0
    steps: int = 0
    perturbed_left: int = 0
    driven_by_student: bool = False
    turns_left: int = 0
    """Number of actions until student and demonstrator alternate."""
    stopped: bool = False

    @property
    def gps_m(self) -> tuple[float, float]:
        """Habitat's GPS: forward and right of the start."""
        local = self.pose.relative_to(self.start)
        return (local.x_m, -local.y_m)

    @property
    def compass_rad(self) -> float:
        """Counter-clockwise from the start, in (-pi, pi]."""
        turned = self.pose.heading_rad - self.start.heading_rad
        return float(np.angle(np.exp(1j * turned)))


class Student(Protocol):
    """Policy for several lanes with a memory for each."""

    def choose(self, lanes: Sequence[Lane], views: Sequence[View]) -> tuple[list[Action], npt.NDArray[np.float16]]:
        """Return an action for each lane, and (lanes, F) features of its image.

        A lane with `steps` 0 begins an episode.
        """


_Row = tuple[npt.NDArray[np.uint8], npt.NDArray[np.float16], tuple[float, float], float, int, int, int, bool]


@dataclass(slots=True)
class _Steps:
    """Columns of a shard for one lane, and the student's features."""

    rows: list[_Row] = field(default_factory=list)
    features: list[npt.NDArray[np.float16]] = field(default_factory=list)


@dataclass(frozen=True, slots=True, eq=False)
class Demonstration:
    """Result for one site."""

    shard: Shard
    features: npt.NDArray[np.float16] | None
    """(N, F) features if a student acted; its shard then has no images."""


def demonstrate(
    world: FlatWorld, plan: Demonstrations, rng: np.random.Generator, student: Student | None = None
) -> Demonstration:
    """Run `plan.episodes` episodes and label every step with the demonstrator's action."""
    collected: list[_Steps] = []
    goals = plan.goals
    for first in range(0, plan.episodes, plan.lanes):
        wave = [goals[(first + k) % len(goals)] for k in range(min(plan.lanes, plan.episodes - first))]
        starts = [world.draw_start(goal, rng) for goal in wave]
        lanes = [Lane(goal, start, start) for goal, start in zip(wave, starts, strict=True)]
        searches = [world.search(goal) for goal in wave]
        steps = [_Steps() for _ in lanes]
        while not all(lane.stopped for lane in lanes):
            active = [k for k, lane in enumerate(lanes) if not lane.stopped]
            views = {k: world.look(lanes[k].pose) for k in active}
            chosen: dict[int, Action] = {}
            if student is not None:
                answers, features = student.choose([lanes[k] for k in active], [views[k] for k in active])
                chosen = dict(zip(active, answers, strict=True))
                for k, row in zip(active, features, strict=True):
                    steps[k].features.append(row)
            for k in active:
                searches[k].look(lanes[k].pose, views[k].in_view)
                expert = searches[k].action_at(lanes[k].pose)
                image = encode(views[k].rgb, plan.jpeg_quality) if student is None else np.zeros(0, np.uint8)
                _keep(steps[k], lanes[k], image, views[k], expert)
                requested = expert
                if student is not None and (_students_turn(lanes[k], plan, rng) or expert is None):
                    requested = chosen[k]
                _advance(world, plan, lanes[k], expert, requested, rng)
        collected += steps
    rows = [row for steps in collected for row in steps.features]
    return Demonstration(_shard(collected), np.stack(rows) if rows else None)


def _students_turn(lane: Lane, plan: Demonstrations, rng: np.random.Generator) -> bool:
    """Return whether the student acts now; student and demonstrator alternate after a few actions.

    A weak student that acts alone, or alternates at every step, soon reaches poses where the demonstrator's action does
    not follow from the images so far, and learns to turn left and right.
    """
    if lane.turns_left == 0:
        lane.driven_by_student = bool(rng.random() < 0.5) if lane.steps == 0 else not lane.driven_by_student
        longest = plan.student_actions if lane.driven_by_student else plan.expert_actions
        lane.turns_left = int(rng.integers(1, longest + 1))
    lane.turns_left -= 1
    return lane.driven_by_student


def _advance(
    world: FlatWorld,
    plan: Demonstrations,
    lane: Lane,
    expert: Action | None,
    requested: Action | None,
    rng: np.random.Generator,
) -> None:
    """Execute the requested action, or sometimes a random move; a wrong STOP is not executed."""
    if expert is Action.STOP and requested is Action.STOP:
        lane.stopped = True
        return
    action = expert if requested is Action.STOP else requested
    if lane.perturbed_left == 0 and rng.random() < plan.perturbed_share:
        lane.perturbed_left = int(rng.integers(1, plan.perturbed_actions + 1))
    at_random = lane.perturbed_left > 0 or action is None
    lane.perturbed_left = max(lane.perturbed_left - 1, 0)
    move(world, lane, _MOVES[int(rng.integers(len(_MOVES)))] if at_random or action is None else action)
    lane.stopped = lane.steps >= plan.max_actions


def move(world: FlatWorld, lane: Lane, action: Action) -> None:
    """Execute an action in a lane."""
    lane.pose = world.lattice.after(lane.pose, action)
    lane.previous = 1 + INDEX[action]
    lane.steps += 1


def _keep(steps: _Steps, lane: Lane, image: npt.NDArray[np.uint8], view: View, expert: Action | None) -> None:
    label = UNLABELLED if expert is None else INDEX[expert]
    inputs = (lane.gps_m, lane.compass_rad, GOALS[lane.goal], lane.previous)
    steps.rows.append((image, view.labels, *inputs, label, lane.steps == 0))


def _shard(collected: Sequence[_Steps]) -> Shard:
    images, views, gps, compass, goals, previous, expert, begins = zip(
        *(row for steps in collected for row in steps.rows), strict=True
    )
    return Shard(
        images=np.concatenate(images),
        ends=np.cumsum([len(image) for image in images]).astype(np.int64),
        views=np.stack(views),
        gps_m=np.array(gps, np.float32),
        compass_rad=np.array(compass, np.float32),
        goals=np.array(goals, np.uint8),
        previous=np.array(previous, np.uint8),
        expert=np.array(expert, np.int8),
        begins=np.array(begins, np.bool_),
    )


@dataclass(frozen=True, slots=True)
class Outcome:
    """Results of a student's episodes, without physics: a blocked move is not a collision."""

    episodes: int
    successes: int
    stops: int
    actions: int


def evaluate(world: FlatWorld, episodes: int, student: Student, rng: np.random.Generator, max_actions: int) -> Outcome:
    """Run episodes of a student alone and judge them by the protocol's distance and step limit."""
    goals = list(GOALS)
    wave = [goals[k % len(goals)] for k in range(episodes)]
    starts = [world.draw_start(goal, rng) for goal in wave]
    lanes = [Lane(goal, start, start) for goal, start in zip(wave, starts, strict=True)]
    successes = stops = 0
    while active := [lane for lane in lanes if not lane.stopped]:
        answers, _ = student.choose(active, [world.look(lane.pose) for lane in active])
        for lane, action in zip(active, answers, strict=True):
            if action is Action.STOP:
                lane.stopped, lane.steps = True, lane.steps + 1
                stops += 1
                near = world.goal_distance_m(lane.goal, lane.pose) < SUCCESS_DISTANCE_M
                successes += near and lane.steps < max_actions
                continue
            move(world, lane, action)
            lane.stopped = lane.steps >= max_actions
    return Outcome(episodes, successes, stops, sum(lane.steps for lane in lanes))
