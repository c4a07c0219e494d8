"""Tables of progress, stages and courses, of sequences, and of the places of failures."""

from collections.abc import Iterator, Mapping
from typing import Any

import shapely

from vsnbench.protocol.course import Stage
from vsnbench.report.analysis.activity import Activity, Rows
from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.courses import site_of
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.failures import FailurePlace
from vsnbench.report.analysis.summary import ReportResults
from vsnbench.report.measures import COUNT, COUNTS, FLAG, TEXT, Form, Measure, Measures, decimals, percents, rates
from vsnbench.report.table import ReportTable, TableCell, without_empty_columns
from vsnbench.report.tables.activity import MODEL
from vsnbench.report.tables.success import SUMMARY
from vsnbench.sites.site import Site

MAX_PLACES = 20
"""Places of failures per condition, on the map and in the table."""


def progress_tables(record: ReportData, results: ReportResults, activity: Activity) -> list[ReportTable]:
    """Return the table of all conditions, and one of the places of failures for each condition that has some."""
    measured = [_measures(results, activity.courses)] if activity.courses else []
    return [*measured, *_places(record, results, activity)]


_STAGES = {
    Stage.NONE: "episodes that came to none of the following stages",
    Stage.SEEN: "furthest stage: an instance was in the field of view with no wall in between",
    Stage.APPROACHED: "furthest stage: the shortest path was at most half of that at the start",
    Stage.REACHED: "furthest stage: STOP would have succeeded",
    Stage.STOPPED: "successes",
}


def _stage(stage: Stage, note: str) -> Measure:
    return Measure(
        "", COUNT, note, lambda row: row["stages"].get(stage, 0) if row["stages"] else None, heading=stage.value
    )


_COVERED = "mean share of the shortest path to the goal that was covered, 0 to 1; not success"
_MIN = "smallest distance from the base's edge to the map's solids, mean"
_LOW = "5th percentile over the path of the distance from the base's edge to the map's solids, mean"
COURSES = Measures(
    MODEL,
    Measure("", decimals(3), _COVERED, "progress", heading="progress"),
    Measure("", percents(), "success rate of all counted episodes", "success_rate", heading="SR %"),
    Measure(
        "mean_oracle_success",
        percents(),
        "oracle success: share of the examined episodes in which STOP would have succeeded at any pose",
        heading="oracle SR %",
    ),
    Measure("examined", COUNT, "number of examined episodes"),
    Measure("stages", COUNTS, "furthest stage → number of examined episodes"),
    *(_stage(stage, note) for stage, note in _STAGES.items()),
    Measure("mean_clearance_min_m", decimals(2), _MIN, heading="clearance (m)", rank=1),
    Measure("mean_clearance_p5_m", decimals(2), _LOW, heading="5th pct. (m)", rank=2),
    Measure(
        "mean_heading_change_deg_per_m",
        decimals(0),
        "change of heading per metre driven; lower is smoother",
        heading="turning (°/m)",
        rank=1,
    ),
    Measure("", decimals(1), "mean duration on the robot's clock", "mean_driving_s", heading="driving (s)", rank=2),
    Measure(
        "mean_waiting_s",
        decimals(1),
        "time at rest without a path, waiting for an answer, mean; of a robot that drives on while the model thinks",
        heading="waiting (s)",
        rank=2,
    ),
    Measure("", decimals(1), "mean inference time, on a real robot", "mean_thinking_s", heading="thinking (s)", rank=3),
)
"""Measures of a condition's courses."""


def _measures(results: ReportResults, courses: Rows) -> ReportTable:
    by_number = {summary.condition.number: summary for summary in results.conditions}
    rows, notes = [], []
    for course in courses:
        summary = by_number[course["condition"]]
        name, total = summary.condition.name, SUMMARY.fields(summary.total)
        rows.append({**course, **total, "model": name})
        if course["examined"] < course["counted"]:
            notes.append(
                f"{name}: stages, clearance and heading change are of {course['examined']} of {course['counted']} "
                "episodes, evenly sampled."
            )
        if total["progress_episodes"] < total["episodes"]:
            notes.append(f"{name}: progress is known for {total['progress_episodes']} of {total['episodes']} episodes.")
    notes.append("From site map and poses. Progress is not success: a model can reach a goal and not stop.")
    names = footnotes([by_number[course["condition"]].condition for course in courses])
    title = "Progress, furthest stage and course"
    return without_empty_columns(COURSES.table("progress", title, rows, notes=tuple(notes), footnotes=names))


def _position(row: Mapping[str, Any]) -> str:
    return "whole sequence" if row["position"] is None else f"goal {row['position']}"


LEGS = Measures(
    MODEL,
    Measure("position", COUNT, "position of the goal in the sequence, from 1", null="for whole sequences"),
    Measure("", TEXT, of=_position, heading="position"),
    *rates("rate", lambda _: None)[:-1],
    Measure(
        "mean_oracle_success",
        percents(),
        "oracle success: share in which STOP would have succeeded at any pose on the way; in whole sequences on the "
        "way to every goal",
        heading="oracle SR %",
    ),
    Measure(
        "progress",
        decimals(3),
        "mean share of a sequence's goals that were reached, 0 to 1",
        heading="progress",
        null="for a position",
    ),
    Measure(
        "given", COUNT, "number of episodes in which the goal was given; otherwise it is a failure", heading="given"
    ),
    Measure("spl", decimals(3), "success weighted by path length, from where the goal was given", heading="SPL"),
    Measure("mean_actions", decimals(1), "mean number of actions, where it was given", heading="actions", rank=1),
    Measure("memory", FLAG, "the model kept its memory of earlier goals, where it was given"),
)
"""Measures of a position in a condition's sequences, and of whole sequences."""


def sequence_table(results: ReportResults, legs: Rows) -> ReportTable:
    """Return the table of success by position in the sequence, and of whole sequences."""
    by_number = {summary.condition.number: summary.condition for summary in results.conditions}
    rows = [{**row, "model": by_number[row["condition"]].name} for row in legs]
    begun = sorted({row["model"] for row in rows if not row["memory"]})
    notes = [f"{name} begins again at each goal." for name in begun]
    notes.append("Goals as the protocol judged them. Goals differ in difficulty: compare models, or vary their order.")
    names = footnotes([by_number[number] for number in dict.fromkeys(row["condition"] for row in legs)])
    title = "Sequences, by position of the goal"
    return LEGS.table("sequences", title, rows, notes=tuple(notes), footnotes=names)


_EPISODES = Form({}, lambda episodes: TableCell(", ".join(map(str, episodes)), links=episodes), number=False)
_PLACE = Measures(
    Measure("", COUNT, "number on the map", lambda row: row[0], heading="place"),
    Measure("", TEXT, of=lambda row: row[1].kind.value, heading="kind"),
    Measure("", TEXT, of=lambda row: row[2], heading="room"),
    Measure("", decimals(2), of=lambda row: row[1].x_m, heading="x (m)", rank=1),
    Measure("", decimals(2), of=lambda row: row[1].y_m, heading="y (m)", rank=1),
    Measure("", COUNT, of=lambda row: len(row[1].episodes), heading="failures"),
    Measure("", _EPISODES, of=lambda row: row[1].episodes, heading="episodes"),
)
"""Measures of a place: its number, the place, and its room."""


def _places(record: ReportData, results: ReportResults, activity: Activity) -> Iterator[ReportTable]:
    by_number = {summary.condition.number: summary.condition for summary in results.conditions}
    for failures in activity.failures:
        if not (places := failures["places"]):
            continue
        condition = by_number[failures["condition"]]
        site = site_of(record, condition)
        left = places[MAX_PLACES:]
        notes = [f"{len(left)} places with fewer failures are left out."] if left else []
        notes.append(f"From {failures['examined']} of {failures['failed']} failures; others have no place.")
        yield _PLACE.table(
            f"failure-places-{condition.number}",
            f"{condition.name}: where it fails",
            [(number, place, _room(site, place)) for number, place in enumerate(places[:MAX_PLACES], start=1)],
            notes=tuple(notes),
            condition=condition.number,
        )


def _room(site: Site | None, place: FailurePlace) -> str:
    here = shapely.Point(place.x_m, place.y_m)
    return next((room.name for room in site.rooms if room.shape.covers(here)), "") if site else ""
