"""Kinds of failure with a place, and clusters of failures."""

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest

from tests.report.analysis.test_courses import walk
from tests.report.records import Attempt, Lab
from vsnbench.protocol.judge import EndReason
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.failures import Failure, FailureKind, failure_places, read_failures
from vsnbench.report.build import build, read
from vsnbench.report.figures.choose import drawings
from vsnbench.report.formats.html import html_page
from vsnbench.values.pose import Pose


def in_view_of_the_bed(lab: Lab) -> Pose:
    """Return a pose in a corner of the bedroom, facing the bed."""
    bed = lab.site.instances("bed")[0].shape
    room = next(room for room in lab.site.rooms if room.shape.contains(bed.centroid))
    x_min, y_min, _, _ = room.shape.bounds
    x_m, y_m = x_min + 0.35, y_min + 0.35
    return Pose(x_m, y_m, math.atan2(bed.centroid.y - y_m, bed.centroid.x - x_m))


def kinds(lab: Lab, poses: Sequence[Pose]) -> tuple[FailureKind, tuple[float, float] | None]:
    failed = Attempt("bed", 1, success=False, end_reason=EndReason.STEP_LIMIT, distance_m=2.0, steps=walk(*poses))
    lab.write([replace(failed, begins=poses[0])])
    (found,) = read_failures(lab.engine(), read(lab.url, Selection()))
    ((kind, times),) = found["kinds"].items()
    assert times == 1
    return kind, (found["places"][0].x_m, found["places"][0].y_m) if found["places"] else None


def test_two_circles_on_the_spot_are_turning_in_circles(lab: Lab) -> None:
    poses = [Pose(5.0, 5.0, math.radians(30 * turn)) for turn in range(40)]
    assert kinds(lab, poses) == (FailureKind.CIRCLING, (5.0, 5.0))


def test_looking_around_for_a_moment_is_not_turning_in_circles(lab: Lab) -> None:
    poses = [Pose(5.0, 5.0, math.radians(30 * min(turn, 12))) for turn in range(40)]
    assert kinds(lab, poses)[0] is not FailureKind.CIRCLING


def test_who_comes_near_with_the_goal_in_view_and_leaves_has_passed_it_there(lab: Lab) -> None:
    near, away = in_view_of_the_bed(lab), Pose(4.0, 5.0, math.pi)
    kind, place = kinds(lab, [away, near, away, away])
    assert kind is FailureKind.PASSED
    assert place == pytest.approx(near.position)


def test_close_failures_of_a_kind_are_one_place_and_the_largest_is_first() -> None:
    stuck, early = FailureKind.STUCK, FailureKind.STOPPED_EARLY
    failures = [
        Failure(4, early, (5.0, 5.0)),
        Failure(1, stuck, (1.0, 1.0)),
        Failure(3, stuck, (1.6, 1.0)),
        Failure(2, stuck, (4.0, 1.0)),
        Failure(5, early, (1.0, 1.0)),
        Failure(6, FailureKind.NEVER_SEEN, None),
    ]
    found = failure_places(failures)
    assert [(place.kind, place.episodes) for place in found] == [
        (stuck, (1, 3)),
        (stuck, (2,)),
        (early, (4,)),
        (early, (5,)),
    ]
    assert (found[0].x_m, found[0].y_m) == pytest.approx((1.3, 1.0))


def test_the_page_shows_the_places_on_a_map_and_links_their_episodes(lab: Lab) -> None:
    poses = [Pose(5.0, 5.0, math.radians(30 * turn)) for turn in range(40)]
    failed = Attempt("bed", 1, success=False, end_reason=EndReason.STEP_LIMIT, distance_m=2.0, steps=walk(*poses))
    lab.write([replace(failed, start=start) for start in (1, 2)])
    report = build(lab.url, Selection(), lab.directory)
    drawn = drawings(report, lab.url)
    assert {"failure-map", "stages"} <= {drawing.name for drawing in drawn}
    tables = report.tables(long=True)
    (places,) = (table for table in tables if table.name == "failure-places-1")
    assert [cell.text for cell in places.rows[0].cells] == [
        *("1", "turned in circles", "living space", "5.00", "5.00", "2", "1, 2")
    ]
    page = html_page(report, tables, drawn)
    assert '<a href="#episode-1">1</a>, <a href="#episode-2">2</a>' in page
    assert 'id="episode-2"' in page
    assert '<a href="all.html#/episode/2">2</a>' in html_page(report, tables, drawn, gallery="all.html#/")
