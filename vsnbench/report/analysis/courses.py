"""Courses of the counted episodes: poses from the record, and the measures of `vsnbench.protocol.course` from them."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from sqlalchemy import Engine, select

from vsnbench.errors import SiteError
from vsnbench.protocol.course import Approach, CourseMap, Stage
from vsnbench.protocol.execution import STACK
from vsnbench.protocol.metrics import heading_change_deg_per_m
from vsnbench.report.analysis.activity import Rows, interventions
from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.reading import Course, read_courses
from vsnbench.results.fields import quantity
from vsnbench.results.model import EpisodeRecord
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.tables import CampaignRow, RobotRow
from vsnbench.sites.site import Site
from vsnbench.sites.targets import legs_of

if TYPE_CHECKING:
    import pandas as pd

MAX_EXAMINED = 1000
"""Maximum number of episodes examined in a report; each takes some 4 ms."""
MIN_EXAMINED = 50
"""Number of episodes examined of a condition even where there are many conditions."""
_PART = 100
"""Courses in memory at a time."""
MEASURES = ("clearance_min_m", "clearance_p5_m", "heading_change_deg_per_m", "waiting_s", "oracle_success")
"""Columns of `measure_courses` that have a mean, in the order of `CourseMeasures`."""


@dataclass(frozen=True, slots=True)
class CourseMeasures:
    """Measures of one course; None if unknown."""

    stage: Stage | None = quantity("furthest stage: `none`, `seen`, `approached`, `reached` or `stopped`")
    clearance_min_m: float | None = quantity("smallest distance from the base's edge to a solid of the site")
    clearance_p5_m: float | None = quantity("5th percentile of that distance over the path")
    heading_change_deg_per_m: float | None = quantity("change of heading in degrees per metre of path")
    waiting_s: float | None = quantity(
        "time at rest without a path, waiting for an answer", absent="where the robot rests while the model thinks"
    )
    oracle_success: bool | None = quantity(
        "STOP would have succeeded at the start or after any action before a collision, for each goal of a sequence; "
        "true for a success",
        absent="if the poses, the site or the goal are unknown",
    )


def site_of(record: ReportData, condition: Condition) -> Site | None:
    """Return the recorded site of a condition; None for an import without a usable site."""
    content = record.sites.get(condition.site_sha256)
    if not content:
        return None
    try:
        return Site.model_validate(content)
    except (ValueError, SiteError):
        return None


def course_map(engine: Engine, record: ReportData, condition: Condition) -> CourseMap | None:
    """Return the map to measure a condition's courses with; None without a site, a protocol or a robot's base."""
    with record_errors(engine), engine.connect() as connection:
        profile = connection.execute(
            select(RobotRow.profile)
            .join(CampaignRow, CampaignRow.robot_id == RobotRow.id)
            .where(CampaignRow.id == condition.campaigns[0])
        ).scalar()
    return _map_of(record.sites.get(condition.site_sha256), profile, condition.protocol)


def _map_of(
    site: Mapping[str, Any] | None, profile: Mapping[str, Any] | None, protocol: Mapping[str, Any] | None
) -> CourseMap | None:
    from vsnbench.protocol.parameters import ProtocolParameters

    radius_m = _positive((profile or {}).get("base"), "radius_m")
    if not site or radius_m is None or not protocol:
        return None
    field_of_view_deg = _positive((profile or {}).get("camera"), "horizontal_fov_deg")
    try:
        rules = ProtocolParameters.from_record(protocol)
        return CourseMap(Site.model_validate(site), radius_m, field_of_view_deg, rules)
    except (ValueError, SiteError):  # another writer's
        return None


def _positive(part: Any, name: str) -> float | None:
    """Return a positive number of a recorded profile; None where it is missing."""
    value = part.get(name) if isinstance(part, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or value <= 0:
        return None
    return float(value)


Examined = dict[int, tuple[Course | None, Approach | None]]
"""Course of each examined episode, and how it came near its goal."""


def measure_courses(
    engine: Engine,
    record: ReportData,
    report: Callable[[int, int], object] = lambda _done, _of: None,
    examined: Examined | None = None,
) -> tuple["pd.DataFrame", Rows]:
    """Measure the courses of the counted episodes, evenly sampled above `MAX_EXAMINED` in all.

    Args:
        engine: the record.
        record: its episodes.
        report: called with the number of measured episodes and of all that will be.
        examined: receives the examined episodes, for `read_failures`.

    Returns:
        One row per examined episode with `episode`, `stage` and `MEASURES`, NaN or None if unknown; and a row of
        `tables.progress.COURSES` for each condition with counted episodes.
    """
    import pandas as pd

    chosen = list(_chosen(record, record.conditions))
    whole, done = sum(len(rows) for _, _, rows in chosen), 0
    found, summaries = [], []
    for condition, counted, rows in chosen:
        own = []
        for line in _measured(engine, record, condition, rows, {} if examined is None else examined):
            own.append(line)
            done += 1
            report(done, whole)
        found += own
        summaries.append(_summary(condition, counted, own))
    return pd.DataFrame(found, columns=["episode", "stage", *MEASURES]), summaries


def _chosen(record: ReportData, conditions: Iterable[Condition]) -> Iterator[tuple[Condition, int, "pd.DataFrame"]]:
    """Yield the conditions with counted episodes, their number, and those of them that are examined."""
    limit = max(MIN_EXAMINED, MAX_EXAMINED // max(1, len(record.conditions)))
    for condition in conditions:
        rows = record.counted(condition)
        if len(rows):
            yield condition, len(rows), rows.iloc[:: max(1, math.ceil(len(rows) / limit))]


def with_stacks(engine: Engine, record: ReportData, examined: Examined) -> ReportData:
    """Return a record with what success tables have of stacks that drive themselves, instead of actions.

    Each episode gets `oracle_success` and `interventions`, both NaN if unknown or of another condition.

    Args:
        engine: the record.
        record: its episodes; returned as it is without a stack.
        examined: receives the examined episodes, as in `measure_courses`.
    """
    stacks = [condition for condition in record.conditions if condition.execution == STACK]
    if not stacks:
        return record
    succeeded = {
        line[0]: line[-1]
        for condition, _, rows in _chosen(record, stacks)
        for line in _measured(engine, record, condition, rows, examined)
    }
    campaigns = [campaign for condition in stacks for campaign in condition.campaigns]
    with record_errors(engine), engine.connect() as connection:
        helped = interventions(connection, campaigns)
    episodes = record.columns.episode.tolist()
    theirs = np.isin(record.columns.condition, [condition.number for condition in stacks])
    return replace(
        record,
        columns=record.columns.and_also(
            oracle_success=np.array([succeeded.get(number) for number in episodes], np.float64),
            interventions=np.where(theirs, [float(helped.get(number, 0)) for number in episodes], np.nan),
        ),
    )


def _measured(
    engine: Engine, record: ReportData, condition: Condition, rows: "pd.DataFrame", examined: Examined
) -> Iterator[tuple[Any, ...]]:
    ground = course_map(engine, record, condition)
    for row, course, approach in examine(engine, ground, rows, examined):
        known = _measure(ground, (course, approach), str(row["goal"]), float(row["path_m"]), bool(row["success"]))
        yield int(row["episode"]), *astuple(known)


def course_of(engine: Engine, episode: EpisodeRecord) -> tuple[CourseMap | None, Course | None, Approach | None]:
    """Return the map of one episode, its course and how it came near its goal; None for what is unknown."""
    origin = episode.provenance
    course = read_courses(engine, [episode.id]).get(episode.id)
    ground = _map_of(origin.site_content, origin.robot_profile, origin.protocol)
    return ground, course, _approach(ground, episode.goal, course)


def measures_of(engine: Engine, episode: EpisodeRecord) -> CourseMeasures:
    """Return the measures of one episode's course."""
    ground, course, approach = course_of(engine, episode)
    path_m = math.nan if episode.path_m is None else episode.path_m
    return _measure(ground, (course, approach), episode.goal, path_m, episode.success is True)


def _measure(
    ground: CourseMap | None,
    seen: tuple[Course | None, Approach | None],
    goal: str,
    path_m: float,
    succeeded: bool,
) -> CourseMeasures:
    course, approach = seen
    poses = course.poses if course else ()
    clearances_m = ground.clearances_m(poses) if ground else ()
    return CourseMeasures(
        stage=approach.stage(succeeded) if approach else Stage.STOPPED if succeeded else None,
        clearance_min_m=float(np.min(clearances_m)) if len(clearances_m) else None,
        clearance_p5_m=float(np.percentile(clearances_m, 5)) if len(clearances_m) else None,
        heading_change_deg_per_m=heading_change_deg_per_m(poses, path_m) if poses and math.isfinite(path_m) else None,
        waiting_s=course.waiting_s if course else None,
        oracle_success=succeeded or _oracle_success(ground, course, approach, goal),
    )


def _oracle_success(
    ground: CourseMap | None, course: Course | None, approach: Approach | None, goal: str
) -> bool | None:
    """Return whether STOP would have succeeded at any pose before a collision, for each goal of a sequence."""
    if ground and course and course.legs:
        return oracle_of_sequence(oracle_of_legs(ground, course), len(legs_of(ground.site, goal)))
    if course is None or approach is None:
        return None
    return bool((approach.reached[:-1] if course.touched else approach.reached).any())


def oracle_of_legs(ground: CourseMap | None, course: Course | None) -> tuple[bool, ...] | None:
    """Return for each goal of a sequence that was given whether STOP would have succeeded at any pose on the way to it.

    It is true for a success. None if the site, a goal or a pose is unknown.
    """
    if ground is None or course is None or not course.legs:
        return None
    reached = []
    for leg, poses in course.legs:
        is_last = leg is course.legs[-1][0]
        flags = ground.reached(leg.goal, poses[:-1] if course.touched and is_last else poses)
        if flags is None:
            return None
        reached.append(leg.success is True or bool(flags.any()))
    return tuple(reached)


def oracle_of_sequence(reached: Sequence[bool] | None, goals: int) -> bool | None:
    """Return whether STOP would have succeeded on the way to each goal of a sequence; None if that is unknown.

    Args:
        reached: that of each goal that was given (`oracle_of_legs`).
        goals: number of goals of the sequence.
    """
    return None if reached is None else len(reached) == goals and all(reached)


def _summary(condition: Condition, counted: int, lines: Sequence[tuple[Any, ...]]) -> dict[str, Any]:
    stages = Counter(line[1] for line in lines)
    found: dict[str, Any] = {
        "condition": condition.number,
        "counted": counted,
        "examined": len(lines),
        "stages": {stage: stages[stage] for stage in Stage if stages[stage]},
    }
    for column, name in enumerate(MEASURES, start=2):
        known = [line[column] for line in lines if line[column] is not None]
        found[f"mean_{name}"] = math.fsum(known) / len(known) if known else math.nan
    return found


def _approach(ground: CourseMap | None, goal: str, course: Course | None) -> Approach | None:
    return ground.approach(goal, course.poses) if ground and course else None


def examine(
    engine: Engine, ground: CourseMap | None, rows: "pd.DataFrame", examined: Examined
) -> Iterator[tuple[dict[str, Any], Course | None, Approach | None]]:
    """Yield each row of episodes with its course, None without steps, and its approach, None where one is unknown.

    Args:
        engine: the record.
        ground: map of their condition; None if it is unknown.
        rows: rows of `ReportData.episodes`.
        examined: episodes that were examined before; receives the others.
    """
    for first in range(0, len(rows), _PART):
        found = rows.iloc[first : first + _PART].to_dict("records")
        part = [{str(name): value for name, value in row.items()} for row in found]
        courses = read_courses(engine, [number for row in part if (number := int(row["episode"])) not in examined])
        for row in part:
            number = int(row["episode"])
            if number not in examined:
                course = courses.get(number)
                examined[number] = course, _approach(ground, str(row["goal"]), course)
            yield row, *examined[number]
