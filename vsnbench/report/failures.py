"""Why episodes failed, from the record alone: what the robot could see, where it went, and how it ended."""

import math
from collections import Counter
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from sqlalchemy import Engine, select

from vsnbench.database.engine import record_errors
from vsnbench.database.tables import Campaign, Episode, Robot, Step
from vsnbench.errors import SiteError
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.pose import Pose
from vsnbench.report.conditions import Condition
from vsnbench.report.record import Record

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from vsnbench.protocol.site import Site

    Floats = npt.NDArray[np.float64]

MOST_FAILURES = 100
"""Of one condition that are looked at, evenly picked."""
NEAR = 2.0
"""Times the success distance: a STOP nearer than this came early, not far off."""
STUCK_STEPS, STUCK_M, STUCK_SHARE = 30, 0.5, 1 / 3
"""So many steps that led no further than this, with such a share of them refused."""


class FailureKind(StrEnum):
    """Why an episode failed; the first that fits, in this order."""

    COLLISION = "collision"
    STOPPED_EARLY = "stopped early"
    STOPPED_FAR = "stopped far off"
    REACHED = "reached, did not stop"
    STUCK = "stuck and refused"
    NEVER_SEEN = "goal never in view"
    NOT_APPROACHED = "seen, not approached"
    UNKNOWN = "not known"


@dataclass(frozen=True, slots=True)
class Failures:
    """Why the episodes of one condition failed."""

    condition: int
    failed: int
    looked_at: tuple[tuple[FailureKind, int], ...]
    """How many of each kind, among those looked at."""
    never_in_view: int | None
    """Of those looked at; None where the poses do not tell."""
    touched: tuple[tuple[str, int], ...]
    """What was collided with, the most often first."""

    @property
    def examined(self) -> int:
        """How many were looked at."""
        return sum(number for _, number in self.looked_at)


@dataclass(frozen=True, slots=True, eq=False)
class _Course:
    """Where the robot was in one failed episode; (n, 3) x, y, heading in the site's frame."""

    poses: "Floats"
    blocked: list[bool]
    touched: str


def read_failures(engine: Engine, record: Record) -> tuple[Failures, ...]:
    """Sort the failures of every condition by kind.

    In view is what a camera of the robot's field of view faces along a line that no wall crosses; furniture in between
    is not counted.

    Raises:
        RecordError: the database cannot be used.
    """
    found = []
    for condition in record.conditions:
        rows = record.counted(condition)
        rows = rows[~rows["success"]]
        if not rows.empty:
            chosen = rows.iloc[:: max(1, math.ceil(len(rows) / MOST_FAILURES))]
            courses = _read_courses(engine, [int(number) for number in chosen["episode"]])
            view = _View(engine, record, condition)
            found.append(_sorted(condition, len(rows), chosen.to_dict("records"), courses, view))
    return tuple(found)


def _sorted(condition: Condition, failed: int, rows: list[Any], courses: dict[int, _Course], view: "_View") -> Failures:
    kinds: Counter[FailureKind] = Counter()
    touched: Counter[str] = Counter()
    unseen = known = 0
    for row in rows:
        course = courses.get(int(row["episode"]))
        seen, nearest_m = view.of(str(row["goal"]), course) if course else (None, math.nan)
        if seen is not None:
            known += 1
            unseen += not seen
        kinds[_kind(row, course, seen, nearest_m, condition.success_distance_m or 1.0)] += 1
        if row["end_reason"] == EndReason.COLLISION.value and course and course.touched:
            touched[course.touched] += 1
    return Failures(
        condition=condition.number,
        failed=failed,
        looked_at=tuple((kind, kinds[kind]) for kind in FailureKind if kinds[kind]),
        never_in_view=unseen if known else None,
        touched=tuple(touched.most_common(5)),
    )


def _kind(row: Any, course: _Course | None, seen: bool | None, nearest_m: float, within_m: float) -> FailureKind:
    if row["end_reason"] == EndReason.COLLISION.value:
        return FailureKind.COLLISION
    if row["end_reason"] == EndReason.STOP.value:
        if math.isnan(row["distance_m"]):
            return FailureKind.UNKNOWN
        return FailureKind.STOPPED_EARLY if row["distance_m"] < NEAR * within_m else FailureKind.STOPPED_FAR
    if course is None or seen is None:
        return FailureKind.UNKNOWN
    if nearest_m < within_m:
        return FailureKind.REACHED
    if _stuck(course):
        return FailureKind.STUCK
    return FailureKind.NOT_APPROACHED if seen else FailureKind.NEVER_SEEN


def _stuck(course: _Course) -> bool:
    last = course.poses[-STUCK_STEPS:, :2]
    refused = course.blocked[-STUCK_STEPS:]
    if len(refused) < STUCK_STEPS:
        return False
    return bool(abs(last - last[0]).max() < STUCK_M) and sum(refused) >= STUCK_SHARE * STUCK_STEPS


class _View:
    """What can be seen in the site of one condition."""

    def __init__(self, engine: Engine, record: Record, condition: Condition) -> None:
        self.site = _site(record, condition)
        with record_errors(engine), engine.connect() as connection:
            profile = connection.execute(
                select(Robot.profile)
                .join(Campaign, Campaign.robot_id == Robot.id)
                .where(Campaign.id == condition.campaigns[0])
            ).scalar()
        camera = (profile or {}).get("camera") or {}
        self.half_view_rad = math.radians(camera.get("horizontal_fov_deg", math.nan)) / 2

    def of(self, goal: str, course: _Course) -> tuple[bool | None, float]:
        """Return whether an instance of the goal was ever in view, and how near the robot came in sight of one."""
        import numpy as np
        import shapely

        from vsnbench.protocol.sight import sight

        if self.site is None or math.isnan(self.half_view_rad) or not len(course.poses):
            return None, math.nan
        instances = self.site.instances(goal)
        if not instances:
            return None, math.nan
        walls = sight(self.site).walls
        places = course.poses[:, :2]
        here = np.asarray(shapely.points(places), dtype=object)
        seen, nearest_m = False, math.inf
        for thing in instances:
            centre = np.array([thing.shape.centroid.x, thing.shape.centroid.y])
            nearest = shapely.get_coordinates(shapely.shortest_line(here, thing.shape)).reshape(-1, 2, 2)[:, 1]
            for ends in (nearest, np.broadcast_to(centre, places.shape)):
                lines = np.asarray(shapely.linestrings(np.stack([places, ends], axis=1)), dtype=object)
                free = ~np.asarray(shapely.intersects(walls, lines), bool)
                way = ends - places
                off = np.angle(np.exp(1j * (np.arctan2(way[:, 1], way[:, 0]) - course.poses[:, 2])))
                seen = seen or bool((free & (np.abs(off) <= self.half_view_rad)).any())
                if ends is nearest and free.any():
                    nearest_m = min(nearest_m, float(np.hypot(way[free, 0], way[free, 1]).min()))
        return seen, nearest_m


def _site(record: Record, condition: Condition) -> "Site | None":
    content = record.sites.get(condition.site_sha256)
    if not content:
        return None
    try:
        from vsnbench.protocol.site import Site

        return Site.model_validate(content)
    except (ValueError, SiteError):
        return None


def _read_courses(engine: Engine, numbers: list[int]) -> dict[int, _Course]:
    import numpy as np

    with record_errors(engine), engine.connect() as connection:
        found = connection.execute(
            select(
                *(Step.episode_id, Episode.start_x_m, Episode.start_y_m, Episode.start_heading_rad),
                *(Step.world_x_m, Step.world_y_m, Step.world_heading_rad),
                *(Step.after_x_m, Step.after_y_m, Step.after_heading_rad, Step.blocked, Step.collision_touched),
            )
            .join(Episode, Episode.id == Step.episode_id)
            .where(Step.episode_id.in_(numbers))
            .order_by(Step.episode_id, Step.number)
        ).all()
    grouped: dict[int, list[Any]] = {}
    for row in found:
        grouped.setdefault(row[0], []).append(row)
    courses = {}
    for number, rows in grouped.items():
        x, y, heading = rows[0][1:4]
        start = None if None in (x, y, heading) else Pose(x, y, heading)
        poses = [(start.x_m, start.y_m, start.heading_rad)] if start else []
        for row in rows:
            if None not in row[4:7]:
                poses.append(tuple(row[4:7]))
            elif start and None not in row[7:10]:
                pose = start.compose(Pose(*row[7:10]))
                poses.append((pose.x_m, pose.y_m, pose.heading_rad))
        touched = next((row[11] for row in reversed(rows) if row[11]), "")
        courses[number] = _Course(np.array(poses, np.float64).reshape(-1, 3), [bool(row[10]) for row in rows], touched)
    return courses
