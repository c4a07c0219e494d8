"""What is to be seen of a session while it runs: written by the run, read by whoever shows it, from any thread."""

from collections import deque
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.battery import Battery, course_of
from vsnbench.protocol.fix import Fix
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.wheeling import way_between
from vsnbench.robots.contract import ReadBattery
from vsnbench.runner.attendant import EndedEpisode, Upcoming
from vsnbench.runner.episode import EpisodePlan, Step
from vsnbench.runner.placing import PlacementLook


@dataclass(frozen=True, slots=True)
class ShownStep:
    """An action as it may be seen."""

    action: str
    """Empty while people are blind to what a model chooses."""
    blocked: bool
    pose: Pose
    """In the site's frame."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """What the robot saw last."""

    number: int
    rgb: npt.NDArray[np.uint8]
    """(H, W, 3)."""


@dataclass(slots=True)
class Board:
    """The trial, its course so far, and what has ended; every attribute is replaced whole or only grows."""

    shows_actions: bool = True
    robot_radius_m: float = 0.2
    done: int = 0
    """Trials that have a result."""
    upcoming: Upcoming | None = None
    """The trial that is about to be run, or is run."""
    began_at: datetime | None = None
    """When it was told to go; None before."""
    steps: list[ShownStep] = field(default_factory=list)
    picture: Picture | None = None
    ended: EndedEpisode | None = None
    """The last one."""
    left_at: Pose | None = None
    """Where the robot was left last, in the site's frame."""
    can_measure: bool = False
    """Where the robot stands can be measured before it goes."""
    looking: str = ""
    """What the robot is doing before it goes: looking, or turning on the spot; empty for nothing."""
    look: PlacementLook | None = None
    """What it saw at its mark."""
    way: list[tuple[float, float]] = field(default_factory=list)
    """From there to the start of the trial, for whoever wheels it; metres."""
    again: deque[int] = field(default_factory=deque)
    """Trials that are to be run again before any other."""
    read_battery: ReadBattery = lambda: None
    """What the base says of its battery now."""
    battery_at_first: Battery | None = None
    """What it said when the first trial began."""

    @property
    def battery_words(self) -> str:
        """From what to what the battery went since the first trial; empty where the base says nothing of it."""
        return course_of(self.battery_at_first, self.read_battery())

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Show the next trial."""
        plan = upcoming.plan
        self.battery_at_first = self.battery_at_first or self.read_battery()
        space = free_space(plan.site, self.robot_radius_m)
        self.way = way_between(space, self.left_at, plan.start.pose) if self.left_at else []
        self.upcoming, self.began_at, self.steps = upcoming, None, []

    def declared_void(self) -> None:
        """Show that the trial that has ended has no result after all, and is to be run again."""
        self.done -= 1
        if self.upcoming is not None:
            self.again.append(self.upcoming.trial)

    def no_longer_void(self, trial: int) -> None:
        """Show that a trial which was declared void has an episode that awaits its judgement after all."""
        self.done += 1
        if trial in self.again:
            self.again.remove(trial)

    def placing_begins(self, *, can_measure: bool) -> None:
        """Show that the robot is being put at its mark."""
        self.can_measure, self.look = can_measure, None

    def goes(self) -> None:
        """Show that it was told to go."""
        self.began_at, self.steps = datetime.now(UTC), []

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Show an action, and what was seen before it."""
        del plan
        action = step.decision.action.value if self.shows_actions else ""
        self.steps.append(ShownStep(action, step.blocked, step.after.pose))
        self.left_at = step.after.pose
        self.picture = Picture(self.picture.number + 1 if self.picture else 1, step.observation.rgb)

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Show how it ended."""
        self.ended, self.began_at = ended, None
        self.done += ended.outcome.verdict.end_reason.is_result
        final: Fix | None = ended.outcome.final
        if final is not None:
            self.left_at = final.pose
