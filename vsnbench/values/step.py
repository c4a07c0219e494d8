"""One recorded step: the same value for writing, viewing and reading."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.values.fix import Fix
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action, Movement
from vsnbench.values.pose import Pose


@dataclass(frozen=True, slots=True)
class StepTimings:
    """Duration of a step, wall time in seconds; None if unknown."""

    sense_s: float | None = None
    infer_s: float | None = None
    move_s: float | None = None


@dataclass(frozen=True, slots=True)
class AnswerTiming:
    """When an answer came and took effect in continuous execution; seconds on the robot's clock."""

    answered_s: float
    """Time of the answer."""
    age_s: float
    """Time from the capture of the image to the effect of the answer; for a stale answer, to when it was dropped."""
    until_s: float
    """Time when the next answer took effect, or when the robot was at rest at the end of the episode."""
    stale: bool = False
    """Whether the answer was dropped because it was too old: the robot drove on along its path."""


def lasted_s(stamp_s: float, result: MotionResult | None, answer: AnswerTiming | None) -> float:
    """Return the time from the observation of a step to the end of its motion; 0 for a refused action."""
    if answer is not None:
        return answer.until_s - stamp_s
    return result.duration_s if result is not None else 0.0


def taken_action(action: Action, answer: AnswerTiming | None) -> Action:
    """Return the action that took effect: NOOP for an answer that was dropped as stale."""
    return Action.NOOP if answer is not None and answer.stale else action


@dataclass(frozen=True, slots=True, eq=False)
class FilmFrame:
    """An image between two answers of a robot that drives on; no model sees it."""

    stamp_s: float
    """Time on the robot's clock."""
    pose: Pose
    """Pose of the robot in the site."""
    rgb: npt.NDArray[np.uint8]
    """(H, W, 3)."""
    commanded: tuple[float, float, float] | None = None
    """Velocity that a stack commanded then: ahead and to the left in m/s, turn in rad/s; None where no stack drives."""


@dataclass(frozen=True, slots=True)
class StepRecord:
    """One action of the policy, from the observation to the measured result."""

    number: int
    """Number of the step from 1; STOP and blocked actions count."""
    action: Action
    raw_action: str = ""
    """The model's own name of the action; default: the action's name."""
    result: MotionResult | None = None
    """None if the depth guard blocked the action before it began; unknown numbers are NaN."""
    refusal: str = ""
    """Why the depth guard refused the action or ended it early, or an empty string."""
    movement: Movement | None = None
    """Parameters of an action that has some."""
    part: tuple[int, int] | None = None
    """Number from 1 and count, for a part of a chunk."""
    answer: AnswerTiming | None = None
    """In continuous execution, when the answer took effect; None where the robot rests while the model thinks."""
    observed: Pose | None = None
    """Odometry at the observation, relative to the start of the episode."""
    stamp_s: float | None = None
    """Time of the image on the robot's clock."""
    world: Fix | None = None
    """Pose of the robot in the site after the motion, if known."""
    rgb_digest: str | None = None
    """Digest of `vsnbench.values.encoding.image_digest`; None if the image was not rendered."""
    depth_digest: str | None = None
    """None without a depth image."""
    rgb_file_digest: str | None = None
    """Digest of the bytes of the colour file; None without a file."""
    depth_file_digest: str | None = None
    timings: StepTimings = field(default_factory=StepTimings)
    probabilities: Mapping[str, float] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)
    recorded_at: datetime | None = None
    """Time of writing; None before."""

    @property
    def blocked(self) -> bool:
        """Whether the depth guard blocked it, before or during the movement."""
        return self.result is None or bool(self.result.blocked)

    @property
    def after(self) -> Pose | None:
        """Odometry after the motion, relative to the start; unchanged for a blocked action."""
        return self.result.pose if self.result else self.observed


def driven_path(start: Pose, steps: Iterable[StepRecord]) -> list[Pose]:
    """Return the start and the pose after each step in the site; from odometry where that pose is unknown."""
    poses = [start]
    for step in steps:
        if step.world is not None:
            poses.append(step.world.pose)
        else:
            poses.append(poses[-1] if step.after is None else start.compose(step.after))
    return poses


def image_offset(step: StepRecord, odometry: Pose) -> Pose:
    """Return where the image of a step was taken, in the frame of the robot when the step before ended.

    A robot that rests while the model thinks was there. One that drives on was on its way there: the answer took effect
    after the image.

    Args:
        step: the step.
        odometry: odometry when the step before ended, relative to the start.
    """
    if step.answer is None or step.observed is None:
        return Pose(0.0, 0.0)
    return step.observed.relative_to(odometry)
