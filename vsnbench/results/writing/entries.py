"""Values that describe how an episode begins and ends."""

import math
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.limits import Spent
from vsnbench.protocol.stop_pose import StopPose
from vsnbench.results.fields import quantity
from vsnbench.text.sanitize import counted
from vsnbench.values.fix import Fix
from vsnbench.values.placement import MeasuredPlacement

INTERVENTION = "intervention"
"""Kind of events for operator actions on a real robot other than placing it: emergency stop, Ctrl-C, a reported
collision, or moving the robot by hand."""

END_REASONS = ", ".join(f"`{reason}`" for reason in EndReason if reason.is_result) + ", or a reason of a void episode"
"""What the end reason of an episode can be, for documentation."""


@dataclass(frozen=True, slots=True)
class SequenceLeg:
    """A goal of a sequence, as the robot searched it."""

    position: int = quantity("position of the goal in the sequence, from 1")
    goal: str = quantity("name of the goal")
    end_reason: str = quantity(END_REASONS)
    success: bool | None = quantity("the protocol's verdict", absent="if void")
    actions: int = quantity("number of actions; STOP and blocked ones count")
    path_m: float = quantity("length of the driven path")
    shortest_m: float | None = quantity("shortest path from where the goal was given to where it counts as reached")
    distance_m: float | None = quantity("distance to the goal at the end")
    goal_instance: str | None = quantity("id of the nearest target that counts")
    memory: bool = quantity("the model kept its memory of earlier goals; otherwise it began again")

    @property
    def text(self) -> str:
        """The leg in one line."""
        outcome = {True: "success", False: "failure", None: "void"}[self.success]
        shortest = "" if self.shortest_m is None else f" (shortest {self.shortest_m:.2f} m)"
        begun = "" if self.memory else ", begun again"
        ended = f"{self.end_reason} after {counted(self.actions, 'action')}"
        return f"{self.goal}: {outcome}, {ended}, path {self.path_m:.2f} m{shortest}{begun}"


def leg_of(position: int, goal: str, verdict: Verdict, spent: Spent, shortest_m: float, *, memory: bool) -> SequenceLeg:
    """Return what the record has of a goal of a sequence; lengths that are not finite are unknown."""
    distance = verdict.distance
    return SequenceLeg(
        position=position,
        goal=goal,
        end_reason=verdict.end_reason.value,
        success=verdict.success,
        actions=spent.actions,
        path_m=spent.path_m,
        shortest_m=shortest_m if math.isfinite(shortest_m) else None,
        distance_m=distance.distance_m if distance is not None and math.isfinite(distance.distance_m) else None,
        goal_instance=None if distance is None else distance.instance,
        memory=memory,
    )


@dataclass(frozen=True, slots=True)
class EpisodeBegin:
    """State of an episode at its beginning. A field with the name of a column is written to it."""

    shortest_m: float | None = None
    """Geodesic distance from the start to the region in which the goal counts as reached."""
    started_at: datetime | None = None
    """Default: now."""
    has_images: bool = True
    """False if the episode has no image files."""
    measured: MeasuredPlacement | None = None
    """Measured start pose; None if it was not measured."""


@dataclass(frozen=True, slots=True)
class EpisodeEnd:
    """How an episode ended; the same value for the runner, the record and a viewer.

    A field with the name of a column is written to it.
    """

    verdict: Verdict
    actions: int
    final: Fix | None = None
    """Pose at the end."""
    wall_duration_s: float | None = None
    error: str = ""
    """Reason why a void episode is void."""
    proposed: bool = False
    """The verdict is a proposal, because the robot is real: unless it is void, a person confirms or overrules it."""
    began: bool = True
    """False if the episode ended before its first observation."""
    path_m: float | None = None
    """Length of the driven path."""
    remaining_m: float | None = None
    """Geodesic distance from the end to the region in which the goal counts as reached."""
    duration_s: float | None = None
    """On the robot's clock."""
    ended_at: datetime | None = None
    """Default: now."""
    stop: StopPose | None = None
    """Pose measured after STOP; None if it was not measured."""
    legs: tuple[SequenceLeg, ...] = ()
    """The goals of a sequence that were given; empty for another goal."""
    unjudged: bool = False
    """Nothing is proposed: the verdict has the end reason only, is not recorded, and a person has to judge."""

    @property
    def end_reason(self) -> EndReason:
        """Why the episode ended."""
        return self.verdict.end_reason


def unjudged_end(reason: EndReason, actions: int, **known: Any) -> EpisodeEnd:
    """Return the end of an episode that a person has to judge; `known` are further fields."""
    return EpisodeEnd(Verdict(reason, None, "not judged yet"), actions, unjudged=True, **known)


@dataclass(frozen=True, slots=True)
class RecoveredEpisode:
    """An episode of a dead process, closed as `interrupted`."""

    id: int
    steps: int
    """Number of committed steps."""
    images_directory: str
