"""A small version of `benchmarks/stop_pose.py`: drifting odometry misjudges stops, the measured pose does not."""

import math

import numpy as np

from benchmarks.stop_pose import PARAMETERS, Row, line, summary
from benchmarks.support.stops import HEADING_RAD, Way, drifted, drive
from vsnbench.robots.profiles import load_profile
from vsnbench.sites.site import load_site
from vsnbench.values.pose import Pose

APARTMENT = load_site("apartment")
TURTLEBOT = load_profile("turtlebot2")
PROFILE = TURTLEBOT.model_copy(update={"camera": TURTLEBOT.camera.resized(160, 120)})


def test_the_odometry_drifts_within_the_stated_errors() -> None:
    straight = [Pose(0.25 * step, 0.0) for step in range(41)]
    ends = [drifted(straight, np.random.default_rng(seed))[-1] for seed in range(200)]
    headings, lengths = [abs(end.heading_rad) for end in ends], [math.hypot(*end.position) / 10 for end in ends]
    assert max(headings) <= HEADING_RAD + 1e-9
    assert max(headings) > 0.9 * HEADING_RAD
    assert 0.94 < min(lengths) < 0.96
    assert 1.04 < max(lengths) <= 1.05


def test_verdicts_by_the_measured_pose_are_right_where_those_by_the_odometry_are_not() -> None:
    start = APARTMENT.start(5)
    rows = []
    for number in range(3):
        poses = tuple(start.pose.compose(Pose(0.25 * step, 0.0)) for step in range(6))
        way, meter = drive(Way(APARTMENT, "chair", start, poses), PROFILE, PARAMETERS, np.random.default_rng(number))
        stop = meter.measure()
        assert stop is not None
        rows.append(Row.of(number, way, stop, 0.0))
    found = summary(rows)
    assert found["measured"] == 3, [line(row) for row in rows]
    assert found["measured_wrong"] == 0
    assert found["covered"] >= 2
    assert found["measured_error_most_m"] < 0.06
