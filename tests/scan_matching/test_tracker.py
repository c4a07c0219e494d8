"""Following a robot by the walls it sees: drift goes, and what odometry cannot have erred is refused."""

import math

import numpy as np
import pytest

from tests.scan_matching.rooms import CAMERA, Wall, box, depth_of
from vsnbench.protocol.pose import Pose
from vsnbench.scan_matching.tracker import WallTracker

ROOM = [*box(-2.0, -1.5, 3.0, 2.5), *box(1.0, 1.2, 1.8, 2.5)]
"""With a cupboard in it."""
TURN = Pose(0.0, 0.0, math.radians(30))
FORWARD = Pose(0.25, 0.0, 0.0)
ROUND = [TURN] * 12 + [FORWARD] * 5 + [TURN] * 3 + [FORWARD] * 4 + [TURN] * 12 + [TURN] * 3 + [FORWARD] * 6 + [TURN] * 6


def drifting(way: Pose) -> Pose:
    """An odometry that counts turns and ways too long, and pulls to the left."""
    return Pose(way.x_m * 1.015, way.y_m, way.heading_rad * 1.015 + 0.01 * way.x_m / 0.25)


def off(one: Pose, other: Pose) -> tuple[float, float]:
    return one.distance_to(other), abs(math.remainder(one.heading_rad - other.heading_rad, math.tau))


def seen(tracker: WallTracker, walls: list[Wall], true: Pose, odometry: Pose) -> Pose:
    return tracker.follow(depth_of(walls, true), CAMERA, odometry).pose


def turned_room(degrees: float) -> list[Wall]:
    turn = Pose.from_degrees(0, 0, degrees)
    return [(turn.compose(Pose(*start)).position, turn.compose(Pose(*end)).position) for start, end in ROOM]


@pytest.mark.parametrize("room_deg", [0.0, 25.0])
def test_drift_is_taken_out_by_the_walls(room_deg: float) -> None:
    walls, tracker = turned_room(room_deg), WallTracker()
    true = odometry = Pose(0.0, 0.0)
    followed = seen(tracker, walls, true, odometry)
    for way in ROUND:
        true, odometry = true.compose(way), odometry.compose(drifting(way))
        followed = seen(tracker, walls, true, odometry)
    assert off(odometry, true)[0] > 0.15
    assert off(odometry, true)[1] > math.radians(10)
    away_m, away_rad = off(followed, true)
    assert away_m < 0.02
    assert away_rad < math.radians(0.4)
    assert tracker.scales == (pytest.approx(1 / 1.015, abs=0.006), pytest.approx(1 / 1.015, abs=0.002))


def test_an_exact_odometry_stays_exact() -> None:
    tracker, true = WallTracker(), Pose(0.0, 0.0)
    seen(tracker, ROOM, true, true)
    for way in ROUND:
        true = true.compose(way)
        away_m, away_rad = off(seen(tracker, ROOM, true, true), true)
        assert away_m < 0.003
        assert away_rad < math.radians(0.1)


@pytest.mark.parametrize("shift_m", [0.03, 0.05, 0.12, 0.4])
def test_what_odometry_cannot_have_erred_is_not_corrected(shift_m: float) -> None:
    """After a move of 25 cm everything in sight stands elsewhere: a wrong match, or furniture that was moved."""
    tracker = WallTracker()
    for turns in range(13):
        here = Pose(0.0, 0.0, turns * TURN.heading_rad)
        tracker.follow(depth_of(ROOM, here), CAMERA, here)
    shifted = [((x0 + shift_m, y0), (x1 + shift_m, y1)) for (x0, y0), (x1, y1) in ROOM]
    answer = tracker.follow(depth_of(shifted, FORWARD), CAMERA, FORWARD)
    assert off(answer.pose, FORWARD)[0] < 0.03
    assert answer.refused == (shift_m == 0.05), "a little farther it is no match at all"


def test_nothing_is_pulled_along_a_corridor() -> None:
    """Two bare walls say nothing of the way along them: that is odometry's."""
    corridor: list[Wall] = [((-30.0, -0.8), (30.0, -0.8)), ((-30.0, 0.8), (30.0, 0.8))]
    tracker, true = WallTracker(), Pose(0.0, 0.0)
    odometry = followed = seen(tracker, corridor, true, true)
    for _ in range(8):
        true, odometry = true.compose(FORWARD), odometry.compose(drifting(FORWARD))
        followed = seen(tracker, corridor, true, odometry)
    assert followed.x_m == pytest.approx(8 * 0.25 * 1.015, abs=0.01)
    assert followed.y_m == pytest.approx(0.0, abs=0.01)
    assert followed.heading_rad == pytest.approx(0.0, abs=math.radians(0.7))


def test_without_anything_to_see_it_is_odometry_alone() -> None:
    tracker, blind = WallTracker(), np.full((120, 160), np.nan, np.float32)
    for number in range(4):
        odometry = Pose(0.25 * number, 0.0, 0.1 * number)
        answer = tracker.follow(blind, CAMERA, odometry)
        assert not answer.corrected
        assert answer.pose.distance_to(odometry) < 1e-9
