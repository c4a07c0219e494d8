"""Tables of progress, stages and courses, and of the places of failures."""

from collections.abc import Iterator, Sequence

import shapely

from vsnbench.protocol.course import Stage
from vsnbench.report.analysis.activity import Activity
from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.courses import CourseSummary, site_of
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.failures import FailurePlace
from vsnbench.report.analysis.summary import Results
from vsnbench.report.table import Cell, Column, ReportTable, decimal, row, without_empty_columns
from vsnbench.report.tables.success import SUMMARY
from vsnbench.sites.site import Site

_OF_TOTAL = ("progress", "progress_episodes", "mean_driving_s", "mean_thinking_s")
MAX_PLACES = 20
"""Places of failures per condition, on the map and in the table."""


def progress_tables(record: ReportData, results: Results, activity: Activity) -> list[ReportTable]:
    """Return the table of all conditions, and one of the places of failures for each condition that has some."""
    measured = [_measures(results, activity.courses)] if activity.courses else []
    return [*measured, *_places(record, results, activity)]


def _measures(results: Results, courses: Sequence[CourseSummary]) -> ReportTable:
    by_number = {summary.condition.number: summary for summary in results.conditions}
    rows, notes = [], []
    for course in courses:
        summary, stages = by_number[course.condition], dict(course.stages)
        total = {key: SUMMARY.named(key).value(summary.total) for key in _OF_TOTAL}
        rows.append(
            row(
                summary.condition.name,
                decimal(total["progress"], 3),
                *(stages.get(stage, 0) if stages else None for stage in Stage),
                decimal(course.clearance_min_m, 2),
                decimal(course.clearance_p5_m, 2),
                decimal(course.heading_change_deg_per_m, 0),
                decimal(total["mean_driving_s"], 1),
                decimal(total["mean_thinking_s"], 1),
            )
        )
        if course.examined < course.counted:
            notes.append(
                f"{summary.condition.name}: stages, clearance and heading change are of {course.examined} of "
                f"{course.counted} episodes, evenly sampled."
            )
        if total["progress_episodes"] < summary.total.episodes:
            notes.append(
                f"{summary.condition.name}: progress is known for {total['progress_episodes']} of "
                f"{summary.total.episodes} episodes."
            )
    stage_notes = {
        Stage.NONE: "episodes that came to none of the following stages",
        Stage.SEEN: "furthest stage: an instance was in the field of view with no wall in between",
        Stage.APPROACHED: "furthest stage: the shortest path was at most half of that at the start",
        Stage.REACHED: "furthest stage: STOP would have succeeded",
        Stage.STOPPED: "successes",
    }
    columns = (
        Column("model", number=False),
        Column("progress", note="mean share of the shortest path to the goal that was covered, 0 to 1; not success"),
        *(Column(stage.value, note=note) for stage, note in stage_notes.items()),
        Column("clearance (m)", rank=1, note="smallest distance from the base's edge to the map's solids, mean"),
        Column("5th pct. (m)", rank=2, note="5th percentile of that distance over the path, mean of the episodes"),
        Column("turning (°/m)", rank=1, note="change of heading per metre driven; lower is smoother"),
        Column("driving (s)", rank=2, note="mean duration on the robot's clock"),
        Column("thinking (s)", rank=3, note="mean inference time, on a real robot"),
    )
    return without_empty_columns(
        ReportTable(
            name="progress",
            title="Progress, furthest stage and course",
            columns=columns,
            rows=tuple(rows),
            notes=(*notes, "From site map and poses. Progress is not success: a model can reach a goal and not stop."),
            footnotes=footnotes([by_number[course.condition].condition for course in courses]),
        )
    )


def _places(record: ReportData, results: Results, activity: Activity) -> Iterator[ReportTable]:
    by_number = {summary.condition.number: summary for summary in results.conditions}
    for failures in activity.failures:
        if not failures.places:
            continue
        condition = by_number[failures.condition].condition
        site = site_of(record, condition)
        left = failures.places[MAX_PLACES:]
        notes = [f"{len(left)} places with fewer failures are left out."] if left else []
        yield ReportTable(
            name=f"failure-places-{failures.condition}",
            title=f"{condition.name}: where it fails",
            columns=(
                Column("place", note="number on the map"),
                Column("kind", number=False),
                Column("room", number=False),
                Column("x (m)", rank=1),
                Column("y (m)", rank=1),
                Column("failures"),
                Column("episodes", number=False),
            ),
            rows=tuple(
                row(
                    number,
                    place.kind.value,
                    _room(site, place),
                    decimal(place.x_m, 2),
                    decimal(place.y_m, 2),
                    len(place.episodes),
                    Cell(", ".join(map(str, place.episodes)), links=place.episodes),
                )
                for number, place in enumerate(failures.places[:MAX_PLACES], start=1)
            ),
            notes=(*notes, f"From {failures.examined} of {failures.failed} failures; others have no place."),
            condition=failures.condition,
        )


def _room(site: Site | None, place: FailurePlace) -> str:
    here = shapely.Point(place.x_m, place.y_m)
    return next((room.name for room in site.rooms if room.shape.covers(here)), "") if site else ""
