"""Measures of recorded courses; missing data give unknown values."""

import math
from dataclasses import replace

import pytest

from tests.report.records import Attempt, Lab, measured, step
from vsnbench.protocol.course import Stage
from vsnbench.protocol.judge import EndReason, success_region
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.analysis import courses
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.courses import measure_courses, measures_of
from vsnbench.report.analysis.summary import summarise
from vsnbench.report.build import build, read
from vsnbench.report.comparison.compare import compare
from vsnbench.report.tables.success import SUMMARY
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import episode_record, list_episodes
from vsnbench.results.writing.entries import INTERVENTION
from vsnbench.sites.site import load_site
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose
from vsnbench.values.step import StepRecord


def at(number: int, place: Pose) -> StepRecord:
    """Return a step that ends at a position of the site."""
    result = MotionResult(completed=True, pose=Pose(0, 0))
    return replace(
        step(number, Action.MOVE_FORWARD), result=result, world=Fix(place, PoseSource.SIMULATED), observed=Pose(0, 0)
    )


def walk(*places: Pose) -> list[StepRecord]:
    return [at(number, place) for number, place in enumerate(places, start=1)]


STARTS = tuple(range(1, 10))
LIVING = Pose(5.0, 5.0, 0.0)


def attempt(start: int, *, success: bool, remaining_m: float = 0.0, ends: Pose = LIVING) -> Attempt:
    return Attempt(
        "bed",
        start,
        success=success,
        shortest_m=4.0,
        remaining_m=remaining_m,
        steps=walk(LIVING, ends),
        end_reason=EndReason.STOP if success else EndReason.STEP_LIMIT,
        begins=LIVING,
    )


def reaching() -> Pose:
    """Return a pose from where STOP succeeds."""
    point = success_region(load_site("apartment"), "bed", ProtocolParameters()).representative_point()
    return Pose(point.x, point.y)


def test_every_counted_episode_is_measured_and_summed_up(lab: Lab) -> None:
    lab.write([attempt(1, success=True), attempt(2, success=False, remaining_m=1.0), Attempt("bed", 3, steps=[])])
    record = read(lab.url, Selection())
    seen = []
    found, (summary,) = measure_courses(lab.engine(), record, lambda done, of: seen.append((done, of)))
    assert seen == [(1, 3), (2, 3), (3, 3)]
    assert found["episode"].tolist() == [1, 2, 3]
    assert found["stage"].tolist()[0] == Stage.STOPPED
    assert found["clearance_min_m"].notna().tolist() == [True, True, False]
    assert (summary["counted"], summary["examined"]) == (3, 3)
    assert summary["stages"][Stage.STOPPED] == 2
    total = summarise(record).conditions[0].total
    assert (measured(total, "progress"), measured(total, "progress_episodes")) == (pytest.approx((1 + 0.75 + 1) / 3), 3)


def test_of_many_episodes_some_are_measured_and_the_number_is_stated(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    lab.write([attempt(start, success=start > 3) for start in STARTS])
    monkeypatch.setattr(courses, "MAX_EXAMINED", 4)
    monkeypatch.setattr(courses, "MIN_EXAMINED", 1)
    report = build(lab.url, Selection())
    assert report.activity is not None
    (summary,) = report.activity.courses
    assert (summary["counted"], summary["examined"]) == (9, 3)
    (table,) = (table for table in report.tables(long=True) if table.name == "progress")
    assert any("3 of 9 episodes" in note for note in table.notes)


def test_without_a_site_only_a_success_has_a_stage_and_nothing_else_is_known(lab: Lab) -> None:
    lab.write([attempt(1, success=True), attempt(2, success=False)])
    record = replace(read(lab.url, Selection()), sites={})
    found, (summary,) = measure_courses(lab.engine(), record)
    assert found["stage"].dropna().tolist() == [Stage.STOPPED]
    assert found["clearance_min_m"].isna().all()
    assert math.isnan(summary["mean_clearance_min_m"])


def test_progress_is_missing_and_not_guessed_where_a_length_is_unknown(lab: Lab) -> None:
    lab.write(
        [replace(attempt(1, success=False), shortest_m=None), replace(attempt(2, success=True), remaining_m=None)]
    )
    (summary,) = summarise(read(lab.url, Selection())).conditions
    assert math.isnan(measured(summary.total, "progress"))
    assert measured(summary.total, "progress_episodes") == 0
    assert [episode.progress for episode in list_episodes(lab.engine(), EpisodeFilter())] == [None, None]


def test_one_episode_has_the_measures_of_its_report(lab: Lab) -> None:
    lab.write([attempt(1, success=False, remaining_m=1.0, ends=Pose(5.5, 5.0, math.pi))])
    found, _ = measure_courses(lab.engine(), read(lab.url, Selection()))
    details = episode_record(lab.engine(), 1)
    own = measures_of(lab.engine(), details)
    assert own.stage == found["stage"].tolist()[0]
    assert own.clearance_min_m == found["clearance_min_m"].tolist()[0]
    assert own.heading_change_deg_per_m == pytest.approx(180 / 2.0)
    assert details.progress == 0.75


def test_progress_is_compared_by_whole_starting_positions(lab: Lab) -> None:
    lab.write([attempt(s, success=False, remaining_m=4.0 - s / 4) for s in STARTS], model="ahead")
    lab.write([attempt(s, success=False, remaining_m=4.0 - s / 8) for s in STARTS], model="behind")
    record = read(lab.url, Selection())
    measured, _ = measure_courses(lab.engine(), record)
    (found,) = compare(replace(record, courses=measured), summarise(record), ["ahead", "behind"])
    effects = {effect.measure: effect for effect in found.effects}
    assert effects["progress"].difference == pytest.approx(sum(s / 32 for s in STARTS) / 9)
    assert effects["progress"].interval.low > 0
    assert effects["heading change (°/m)"].first == 0
    assert "thinking time (s)" not in effects, "the simulator's clock excludes it"
    (without,) = compare(record, summarise(record), ["ahead", "behind"])
    assert "minimum clearance (m)" not in {effect.measure for effect in without.effects}


@pytest.mark.parametrize(
    ("places", "touched", "expected"),
    [
        ((LIVING, "goal", LIVING), "", True),
        ((LIVING, LIVING), "", False),
        ((LIVING, "goal"), "a wall", False),  # STOP does not succeed after the collision
        (("goal", LIVING), "a wall", True),
    ],
)
def test_oracle_success_is_that_stop_would_have_succeeded_on_the_way(
    lab: Lab, places: tuple[Pose | str, ...], touched: str, expected: bool
) -> None:
    steps = walk(*(reaching() if place == "goal" else place for place in places))
    if touched:
        collision = Collision(CollisionSource.CONTACT, touched)
        steps[-1] = replace(steps[-1], result=replace(steps[-1].result, completed=False, collision=collision))
    failed = replace(attempt(1, success=False), steps=steps)
    lab.write([failed, attempt(2, success=True)])
    found, (summary,) = measure_courses(lab.engine(), read(lab.url, Selection()))
    assert found["oracle_success"].tolist() == [expected, True]
    assert summary["mean_oracle_success"] == (1 + expected) / 2
    assert measures_of(lab.engine(), episode_record(lab.engine(), 1)).oracle_success is expected


@pytest.mark.parametrize("activity", [True, False])
def test_a_stack_has_oracle_success_and_interventions_instead_of_actions(lab: Lab, activity: bool) -> None:
    attempts = [attempt(1, success=True), attempt(2, success=False, ends=reaching()), attempt(3, success=False)]
    lab.write(attempts, model="stack", protocol=ProtocolParameters().driven_by_stack())
    lab.write(attempts, model="vlv")
    with lab.journal() as journal:
        for number in (2, 2, 5):
            journal.add_event(INTERVENTION, "moved by hand", episode_id=number)
    report = build(lab.url, Selection(), activity=activity)
    stack, model = (table for table in report.tables() if table.name.startswith("goals-"))
    cells = dict(zip([column.heading for column in stack.columns], stack.rows[0].cells, strict=True))
    assert (cells["oracle SR %"].text, cells["interv."].text) == ("66.67", "2")
    assert "actions" not in cells
    names = {column.heading for column in model.columns}
    assert "actions" in names
    assert not names & {"oracle SR %", "interv."}
    fields = [SUMMARY.fields(summary.total) for summary in report.results.conditions]
    assert [(found["oracle_success"], found["interventions"]) for found in fields] == [(2 / 3, 2), (None, None)]
