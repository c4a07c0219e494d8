"""Classifies failures from the record: what the robot could see, where it went and how it ended."""

import math
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from sqlalchemy import Engine, select

from vsnbench.errors import SiteError
from vsnbench.protocol.judge import EndReason
from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.tables import Campaign, Episode, Robot, Step
from vsnbench.values.pose import Pose

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from vsnbench.sites.site import Site

    Floats = npt.NDArray[np.float64]

MAX_FAILURES = 100
"""Maximum number of failures examined per condition, evenly sampled."""
NEAR = 2.0
"""Multiple of the success distance below which a STOP counts as early rather than far off."""
STUCK_STEPS, STUCK_M, STUCK_SHARE = 30, 0.5, 1 / 3
"""Stuck: the last steps stayed within this distance, and at least this share of them was blocked."""


class FailureKind(StrEnum):
    """Causes of failure; the first that applies, in this order."""

    COLLISION = "collision"
    STOPPED_EARLY = "stopped early"
    STOPPED_FAR = "stopped far off"
    REACHED = "reached, did not stop"
    STUCK = "stuck and blocked"
    NEVER_SEEN = "goal never in view"
    NOT_APPROACHED = "seen, not approached"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Failures:
    """Causes of the failures of one condition."""

    condition: int
    failed: int
    kinds: tuple[tuple[FailureKind, int], ...]
    """Number of examined failures of each kind."""
    never_in_view: int | None
    """Examined failures in which the goal was never in view; None if the poses are unknown."""
    touched: tuple[tuple[str, int], ...]
    """Objects collided with, most frequent first."""

    @property
    def examined(self) -> int:
        """Number of examined failures."""
        return sum(number for _, number in self.kinds)


@dataclass(frozen=True, slots=True, eq=False)
class _Course:
    """Poses of one failed episode: (n, 3) x, y, heading in the site's frame."""

    poses: "Floats"
    blocked: list[bool]
    touched: str


def read_failures(engine: Engine, record: ReportData) -> tuple[Failures, ...]:
    """Classify the failures of every condition.

    An instance is in view if it is within the camera's field of view and no wall is in between. Furniture does not
    block the view.

    Raises:
        RecordError: the database cannot be used.
    """
    found = []
    for condition in record.conditions:
        rows = record.counted(condition)
        rows = rows[~rows["success"]]
        if not rows.empty:
            chosen = rows.iloc[:: max(1, math.ceil(len(rows) / MAX_FAILURES))]
            courses = _read_courses(engine, [int(number) for number in chosen["episode"]])
            view = _View(engine, record, condition)
            found.append(_sorted(condition, len(rows), chosen.to_dict("records"), courses, view))
    return tuple(found)


def failure_kinds(engine: Engine, record: ReportData, known: Collection[int] = ()) -> Iterator[tuple[int, FailureKind]]:
    """Yield the kind of every counted failure, by episode; without those in `known`.

    Raises:
        RecordError: the database cannot be used.
    """
    for condition in record.conditions:
        rows = record.counted(condition)
        rows = rows[~rows["success"] & ~rows["episode"].isin(list(known))]
        if rows.empty:
            continue
        view = _View(engine, record, condition)
        for first in range(0, len(rows), MAX_FAILURES):
            some = rows.iloc[first : first + MAX_FAILURES]
            courses = _read_courses(engine, [int(number) for number in some["episode"]])
            for row in some.to_dict("records"):
                yield int(row["episode"]), _examined(condition, row, courses, view)[2]


def _examined(
    condition: Condition, row: Any, courses: dict[int, _Course], view: "_View"
) -> tuple[_Course | None, bool | None, FailureKind]:
    """Return the course of a failure, whether the goal was ever in view, and its kind."""
    course = courses.get(int(row["episode"]))
    seen, nearest_m = view.of(str(row["goal"]), course) if course else (None, math.nan)
    return course, seen, _kind(row, course, seen, nearest_m, condition.success_distance_m or 1.0)


def _sorted(condition: Condition, failed: int, rows: list[Any], courses: dict[int, _Course], view: "_View") -> Failures:
    kinds: Counter[FailureKind] = Counter()
    touched: Counter[str] = Counter()
    unseen = known = 0
    for row in rows:
        course, seen, kind = _examined(condition, row, courses, view)
        if seen is not None:
            known += 1
            unseen += not seen
        kinds[kind] += 1
        if row["end_reason"] == EndReason.COLLISION.value and course and course.touched:
            touched[course.touched] += 1
    return Failures(
        condition=condition.number,
        failed=failed,
        kinds=tuple((kind, kinds[kind]) for kind in FailureKind if kinds[kind]),
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
    """Visibility of goals in the site of one condition."""

    def __init__(self, engine: Engine, record: ReportData, condition: Condition) -> None:
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
        """Return whether an instance was ever in view, and the smallest distance to an instance in sight."""
        import numpy as np
        import shapely

        from vsnbench.sites.geometry.line_of_sight import sight
        from vsnbench.sites.targets import targets_of

        if self.site is None or math.isnan(self.half_view_rad) or not len(course.poses):
            return None, math.nan
        targets = targets_of(self.site, goal)
        if not targets:
            return None, math.nan
        walls = sight(self.site).walls
        places = course.poses[:, :2]
        here = np.asarray(shapely.points(places), dtype=object)
        seen, nearest_m = False, math.inf
        for target in targets:
            centre = np.array([target.shape.centroid.x, target.shape.centroid.y])
            nearest = shapely.get_coordinates(shapely.shortest_line(here, target.shape)).reshape(-1, 2, 2)[:, 1]
            for ends in (nearest, np.broadcast_to(centre, places.shape)):
                lines = np.asarray(shapely.linestrings(np.stack([places, ends], axis=1)), dtype=object)
                free = ~np.asarray(shapely.intersects(walls, lines), bool)
                way = ends - places
                off = np.angle(np.exp(1j * (np.arctan2(way[:, 1], way[:, 0]) - course.poses[:, 2])))
                seen = seen or bool((free & (np.abs(off) <= self.half_view_rad)).any())
                if ends is nearest and free.any():
                    nearest_m = min(nearest_m, float(np.hypot(way[free, 0], way[free, 1]).min()))
        return seen, nearest_m


def _site(record: ReportData, condition: Condition) -> "Site | None":
    content = record.sites.get(condition.site_sha256)
    if not content:
        return None
    try:
        from vsnbench.sites.site import Site

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
