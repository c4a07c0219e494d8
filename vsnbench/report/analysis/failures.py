"""Classifies failures from the record: what the robot could see, where it went, how it ended, and at which place."""

import itertools
import math
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from sqlalchemy import Engine

from vsnbench.protocol.course import Approach
from vsnbench.protocol.judge import EndReason
from vsnbench.report.analysis.activity import Rows
from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.courses import Examined, course_map, examine
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.reading import Course
from vsnbench.text.sanitize import counted
from vsnbench.values.pose import wrap_angle

MAX_FAILURES = 100
"""Maximum number of failures examined per condition, evenly sampled."""
NEAR = 2.0
"""Multiple of the success distance below which a STOP counts as early rather than far off."""
STUCK_STEPS, STUCK_M, STUCK_SHARE = 30, 0.5, 1 / 3
"""Stuck: the last steps stayed within this distance, and at least this share of them was blocked."""
CIRCLES = 2.0
"""Turning in circles: the last `STUCK_STEPS` steps stayed within `STUCK_M` and turned this many full circles."""
PASSED_M = 1.0
"""Passed: with the goal in view, the way to it was this much shorter than at the end."""
PLACE_M = 1.0
"""Failures of one kind within this distance of the first of them are one place."""


class FailureKind(StrEnum):
    """Causes of failure; the first that applies, in this order."""

    COLLISION = "collision"
    STOPPED_EARLY = "stopped early"
    STOPPED_FAR = "stopped far off"
    REACHED = "reached, did not stop"
    STUCK = "stuck and blocked"
    CIRCLING = "turned in circles"
    NEVER_SEEN = "goal never in view"
    PASSED = "passed in view"
    NOT_APPROACHED = "seen, not approached"
    UNKNOWN = "unknown"


DESCRIPTIONS = {
    FailureKind.COLLISION: "The robot touched something.",
    FailureKind.STOPPED_EARLY: "The model answered STOP near the goal, outside the success distance.",
    FailureKind.STOPPED_FAR: "The model answered STOP far from the goal.",
    FailureKind.REACHED: "The robot was where STOP would have succeeded, and the model drove on.",
    FailureKind.STUCK: "The robot stayed in one place at the end, and the guard refused its moves.",
    FailureKind.CIRCLING: "The robot turned in circles at the end.",
    FailureKind.NEVER_SEEN: "The goal was never in the camera's view.",
    FailureKind.PASSED: "The goal was in view, and the robot drove away from it again.",
    FailureKind.NOT_APPROACHED: "The goal was in view, and the robot did not reach it.",
    FailureKind.UNKNOWN: "The record does not tell why.",
}
"""Causes as sentences."""


@dataclass(frozen=True, slots=True)
class Failure:
    """One examined failure."""

    episode: int
    kind: FailureKind
    place: tuple[float, float] | None
    """(x, y) in the site: where it ended, or nearest to the goal if that was reached or passed. None if the kind has no
    place or the poses are unknown."""
    words: str = ""
    """Its course in one sentence."""


@dataclass(frozen=True, slots=True)
class FailurePlace:
    """Failures of one kind at one place."""

    kind: FailureKind
    x_m: float
    y_m: float
    """Mean position of the failures."""
    episodes: tuple[int, ...]


def read_failures(engine: Engine, record: ReportData, examined: Examined | None = None) -> Rows:
    """Classify the failures of every condition with some, as rows of `tables.failures.FAILURES`.

    An instance is in view if it is within the camera's field of view and no wall is in between. Furniture does not
    block the view.

    Args:
        engine: the record.
        record: its episodes.
        examined: episodes that `measure_courses` examined, which need not be read again.
    """
    found = []
    for condition in record.conditions:
        rows = record.counted(condition)
        rows = rows[~rows["success"]]
        if rows.empty:
            continue
        ground = course_map(engine, record, condition)
        touched: Counter[str] = Counter()
        unseen = known = 0
        failures = []
        sample = rows.iloc[:: max(1, math.ceil(len(rows) / MAX_FAILURES))]
        for row, course, approach in examine(engine, ground, sample, {} if examined is None else examined):
            failures.append(_failure(condition, row, course, approach))
            if approach is not None and approach.in_view is not None:
                known += 1
                unseen += not approach.in_view.any()
            if row["end_reason"] == EndReason.COLLISION.value and course and course.touched:
                touched[course.touched] += 1
        kinds = Counter(failure.kind for failure in failures)
        found.append(
            {
                "condition": condition.number,
                "failed": len(rows),
                "examined": len(failures),
                "kinds": {kind: kinds[kind] for kind in FailureKind if kinds[kind]},
                "never_in_view": unseen if known else None,
                "touched": dict(touched.most_common(5)),
                "examples": _examples(failures, set(rows.loc[rows["images_directory"] != "", "episode"])),
                "places": failure_places(failures),
            }
        )
    return found


def _examples(failures: Sequence[Failure], pictured: Collection[int]) -> list[dict[str, Any]]:
    """Return an example of each kind, the most frequent kind first: the first failure with images, if there is one."""
    by_kind: dict[FailureKind, list[Failure]] = {}
    for failure in sorted(failures, key=lambda failure: failure.episode):
        by_kind.setdefault(failure.kind, []).append(failure)
    found = []
    for kind, own in sorted(by_kind.items(), key=lambda item: (-len(item[1]), list(FailureKind).index(item[0]))):
        example = next((failure for failure in own if failure.episode in pictured), own[0])
        words = {"kind": kind, "description": DESCRIPTIONS[kind], "words": example.words}
        found.append({**words, "episode": example.episode, "pictured": example.episode in pictured})
    return found


def failure_kinds(engine: Engine, record: ReportData, known: Collection[int] = ()) -> Iterator[tuple[int, FailureKind]]:
    """Yield the kind of every counted failure, by episode; without those in `known`."""
    for condition in record.conditions:
        rows = record.counted(condition)
        rows = rows[~rows["success"] & ~rows["episode"].isin(list(known))]
        if rows.empty:
            continue
        ground = course_map(engine, record, condition)
        for row, course, approach in examine(engine, ground, rows, {}):
            failure = _failure(condition, row, course, approach)
            yield failure.episode, failure.kind


def failure_places(failures: Sequence[Failure]) -> tuple[FailurePlace, ...]:
    """Group failures of one kind that are within `PLACE_M` of the first of a group; most frequent first."""
    groups: list[list[Failure]] = []
    for failure in sorted(failures, key=lambda failure: failure.episode):
        if failure.place is None:
            continue
        for group in groups:
            first = group[0]
            if first.kind is failure.kind and first.place and math.dist(first.place, failure.place) <= PLACE_M:
                group.append(failure)
                break
        else:
            groups.append([failure])
    places = []
    for group in groups:
        at = [failure.place for failure in group if failure.place]
        x_m, y_m = (math.fsum(place[axis] for place in at) / len(at) for axis in (0, 1))
        places.append(FailurePlace(group[0].kind, x_m, y_m, tuple(failure.episode for failure in group)))
    return tuple(sorted(places, key=lambda place: (-len(place.episodes), place.episodes)))


def _failure(condition: Condition, row: Any, course: Course | None, approach: Approach | None) -> Failure:
    within_m = condition.success_distance_m or 1.0
    kind = failure_kind(row["end_reason"], float(row["distance_m"]), course, approach, within_m)
    place = None
    if course and course.poses:
        if kind in (FailureKind.REACHED, FailureKind.PASSED) and approach is not None:
            place = course.poses[_nearest(approach)].position
        elif kind not in (FailureKind.NEVER_SEEN, FailureKind.NOT_APPROACHED, FailureKind.UNKNOWN):
            place = course.poses[-1].position
    return Failure(int(row["episode"]), kind, place, _in_words(row, course, approach))


def _in_words(row: Any, course: Course | None, approach: Approach | None) -> str:
    """Return the course of an episode in one sentence, from what is known of it."""
    ended = str(row["end_reason"]).replace("_", " ")
    path = f" over {row['path_m']:.1f} m" if math.isfinite(row["path_m"]) else ""
    start = f" from starting position {row['start']}" if row["start"] else ""
    actions = f" {counted(int(row['actions']), 'action')}" if math.isfinite(row["actions"]) else ""  # a stack has none
    parts = [f"{row['goal']}{start}:{actions}{path}, ended by {ended}"]
    if math.isfinite(row["distance_m"]):
        parts.append(f"{row['distance_m']:.2f} m from the goal")
    if approach is not None and len(approach.remaining_m):
        nearest_m, left_m = float(np.min(approach.remaining_m)), float(approach.remaining_m[-1])
        if math.isfinite(nearest_m) and left_m - nearest_m >= PASSED_M:
            parts.append(f"after it had been {nearest_m:.1f} m of path from it")
    if course is not None and course.touched:
        parts.append(f"touching {course.touched}")
    return ", ".join(parts) + "."


def _nearest(approach: Approach) -> int:
    """Return the index of the pose nearest to the goal, among those with the goal in view if there are any."""
    remaining_m = approach.remaining_m
    if approach.in_view is not None and approach.in_view.any():
        remaining_m = np.where(approach.in_view, remaining_m, np.inf)
    return int(np.argmin(remaining_m))


def failure_kind(
    end_reason: str | None, distance_m: float, course: Course | None, approach: Approach | None, within_m: float
) -> FailureKind:
    """Return the cause of a failure.

    Args:
        end_reason: reason of the episode's end, as recorded.
        distance_m: distance to the goal at the end; NaN if unknown.
        course: poses of the episode; None if they are unknown.
        approach: how it came near its goal; None if that is unknown.
        within_m: success distance.
    """
    if end_reason == EndReason.COLLISION.value:
        return FailureKind.COLLISION
    if end_reason == EndReason.STOP.value:
        if math.isnan(distance_m):
            return FailureKind.UNKNOWN
        return FailureKind.STOPPED_EARLY if distance_m < NEAR * within_m else FailureKind.STOPPED_FAR
    if course is None or approach is None or approach.in_view is None:
        return FailureKind.UNKNOWN
    if approach.reached.any():
        return FailureKind.REACHED
    if (motionless := _kind_without_movement(course)) is not None:
        return motionless
    if not approach.in_view.any():
        return FailureKind.NEVER_SEEN
    left_m = float(approach.remaining_m[-1] - approach.remaining_m[_nearest(approach)])
    return FailureKind.PASSED if math.isfinite(left_m) and left_m >= PASSED_M else FailureKind.NOT_APPROACHED


def _kind_without_movement(course: Course) -> FailureKind | None:
    """Return why the last steps did not leave their place; None if they did."""
    last, refused = course.poses[-STUCK_STEPS:], course.blocked[-STUCK_STEPS:]
    if len(refused) < STUCK_STEPS:
        return None
    if any(max(abs(pose.x_m - last[0].x_m), abs(pose.y_m - last[0].y_m)) >= STUCK_M for pose in last):
        return None
    if sum(refused) >= STUCK_SHARE * STUCK_STEPS:
        return FailureKind.STUCK
    turned = sum(abs(wrap_angle(b.heading_rad - a.heading_rad)) for a, b in itertools.pairwise(last))
    return FailureKind.CIRCLING if turned >= CIRCLES * math.tau else None
