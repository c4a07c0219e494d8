"""Live state of a session, written by the main thread and read by displays from any thread."""

from collections import deque
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.carry_path import carry_path
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.limits import Spent
from vsnbench.robots.contract import BatteryReader
from vsnbench.runner.episode.step import Step
from vsnbench.runner.operator.contract import EndedEpisode, Upcoming
from vsnbench.runner.operator.placing import PlacementLook
from vsnbench.values.battery import Battery, course_of
from vsnbench.values.pose import Pose


@dataclass(frozen=True, slots=True)
class ShownStep:
    """An action as the operator may see it."""

    action: str
    """Empty in a blind study."""
    blocked: bool
    pose: Pose
    """In the site's frame."""


@dataclass(slots=True)
class SessionState:
    """The current trial and the results so far. Attributes are only replaced or extended, never edited in place."""

    shows_actions: bool = True
    robot_radius_m: float = 0.2
    done: int = 0
    """Number of trials with a result."""
    upcoming: Upcoming | None = None
    """The trial that is about to run or is running."""
    began_at: datetime | None = None
    """When the operator let the robot drive; None before."""
    steps: list[ShownStep] = field(default_factory=list)
    spent: Spent = field(default_factory=Spent)
    """What the current episode has used of its limits."""
    picture: npt.NDArray[np.uint8] | None = None
    """Last image of the robot's camera, (H, W, 3)."""
    pictures: int = 0
    """Number of images so far."""
    ended: EndedEpisode | None = None
    """The last finished episode."""
    left_at: Pose | None = None
    """Last known pose of the robot, in the site's frame."""
    can_measure: bool = False
    """The robot's pose can be measured before it drives."""
    measures_on_the_way: bool = False
    """It can be measured between two actions as well."""
    can_declare: bool = False
    """The operator says when the robot of this episode has arrived."""
    whereabouts: str = ""
    """Result of the last measurement between two actions of this episode."""
    looking: str = ""
    """What the robot is doing to measure its pose: looking, or turning around; empty for nothing."""
    look: PlacementLook | None = None
    """Result of the last measurement at the mark."""
    way: list[tuple[float, float]] = field(default_factory=list)
    """Path from the robot to its next start, for the operator who moves it; metres."""
    to_repeat: deque[int] = field(default_factory=deque)
    """IDs of trials to run again before any other."""
    read_battery: BatteryReader = lambda: None
    """Reads the battery of the robot's base."""
    battery_at_first: Battery | None = None
    """Battery when the first trial began."""

    @property
    def battery_text(self) -> str:
        """Change of the battery since the first trial; empty where the base reports none."""
        return course_of(self.battery_at_first, self.read_battery())

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Set the next trial."""
        plan = upcoming.plan
        self.battery_at_first = self.battery_at_first or self.read_battery()
        space = free_space(plan.site, self.robot_radius_m)
        self.way = carry_path(space, self.left_at, plan.start.pose) if self.left_at else []
        self.upcoming, self.began_at, self.steps = upcoming, None, []

    def declare_void(self) -> None:
        """Count the last trial as not done, and have it run again."""
        self.done -= 1
        if self.upcoming is not None:
            self.to_repeat.append(self.upcoming.trial)

    def retract_void(self, trial: int) -> None:
        """Count a trial as done again whose episode is no longer void."""
        self.done += 1
        if trial in self.to_repeat:
            self.to_repeat.remove(trial)

    def placing_begins(self, *, can_measure: bool) -> None:
        """Start the placement of the robot."""
        self.can_measure, self.look = can_measure, None

    def driving_begins(self) -> None:
        """Register that the operator let the robot drive."""
        self.began_at, self.steps, self.spent, self.whereabouts = datetime.now(UTC), [], Spent(), ""
        self.can_declare = False

    def step_taken(self, step: Step) -> None:
        """Add an action, and the image before it."""
        action = step.decision.action.value if self.shows_actions else ""
        self.steps.append(ShownStep(action, step.blocked, step.site_after.pose))
        self.left_at, self.spent = step.site_after.pose, step.spent
        self.picture, self.pictures = step.observation.rgb, self.pictures + 1

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Set the last finished episode."""
        self.ended, self.began_at = ended, None
        self.done += ended.outcome.verdict.end_reason.is_result
        if (final := ended.outcome.final) is not None:
            self.left_at = final.pose
