"""The worked examples of three robots, against stand-ins that behave as the SDKs' documentation says."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.robots.adapter.adapters import by_velocity, driven
from tests.robots.adapter.vendor_stand_ins import LateBase, SportSdk, SpotSdk, StretchRobot
from vsnbench.values.movement import Drive, Move, Trajectory, Waypoint
from vsnbench.values.pose import Pose

import go2  # isort: skip  # adapters has their path
import spot  # isort: skip
import stretch  # isort: skip

Made = tuple[by_velocity.Base, LateBase, Any]


def _timed(base: Any, late: LateBase, wait: Callable[[], None], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(base, "_wait", wait)
    monkeypatch.setattr(type(base), "now_s", property(lambda _: late.time_s))


def made_go2(monkeypatch: pytest.MonkeyPatch) -> Made:
    late = LateBase(0.12, 0.2)
    sdk = SportSdk(late)
    monkeypatch.setattr(go2.Go2, "now_s", property(lambda _: late.time_s))
    base = go2.Go2(sdk=(sdk, sdk, sdk.subscribe))
    _timed(base, late, lambda: (late.advance(by_velocity.PERIOD_S), sdk.publish()), monkeypatch)
    return base, late, sdk


def made_spot(monkeypatch: pytest.MonkeyPatch) -> Made:
    late = LateBase(0.05, 0.05)
    sdk = SpotSdk(late)
    base = spot.Spot(sdk=sdk.functions())
    _timed(base, late, lambda: sdk.advance(by_velocity.PERIOD_S), monkeypatch)
    return base, late, sdk


def made_stretch(monkeypatch: pytest.MonkeyPatch) -> Made:
    late = LateBase(dead_time_s=0.05)
    robot = StretchRobot(late)
    depth = np.full((48, 64), 1500, np.uint16)
    base = stretch.Stretch(robot, lambda: (np.zeros((48, 64, 3), np.uint8), depth, late.time_s))
    _timed(base, late, lambda: (late.advance(by_velocity.PERIOD_S), robot.pull()), monkeypatch)
    return base, late, robot


ROBOTS = {"go2": made_go2, "spot": made_spot, "stretch": made_stretch}


@pytest.fixture(params=sorted(ROBOTS))
def made(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Made:
    return ROBOTS[request.param](monkeypatch)


def finish(base: by_velocity.Base, movement: Drive, deadline_s: float = 60.0) -> dict[str, Any]:
    steps = base.execute(movement.to_json(), deadline_s)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


TWENTY = [
    *[Move(turn_rad=math.radians(turn), holds_heading=True) for turn in (30, -30, 30, 30, 15, -15, -30)],
    *[Move(length, holds_heading=True) for length in (0.25, 0.25, -0.25, 0.25, 0.25)],
    *[Move(0.5, 0.7), Move(-0.3, -1.2), Move(1.0)],
    *[Waypoint(0.8, 0.3), Waypoint(-0.5, 0.4), Waypoint(0.6, -0.4, 1.0)],
    *[Trajectory(((0.5, 0.0), (0.5, 0.5))), Trajectory(((0.4, 0.2), (0.8, 0.0)))],
]


def test_twenty_movements_end_where_they_should(made: Made) -> None:
    base, late, _ = made
    worst_m = worst_deg = 0.0
    for movement in TWENTY:
        before = late.at
        assert finish(base, movement) == {"completed": True}, movement
        late.advance(1.0)
        if isinstance(movement, Move):
            end = Pose(0.0, 0.0, movement.turn_rad).compose(Pose(movement.distance_m, 0.0))
            turned = late.at.heading_rad - before.heading_rad - movement.turn_rad
            worst_deg = max(worst_deg, abs(math.degrees(turned)))
        else:
            end = Pose(movement.x_m, movement.y_m) if isinstance(movement, Waypoint) else Pose(*movement.points[-1])
        worst_m = max(worst_m, before.compose(end).distance_to(late.at))
    assert worst_m < 0.05
    assert worst_deg < 3.0


def test_the_robot_stands_after_a_deadline(made: Made) -> None:
    base, late, _ = made
    assert finish(base, Move(2.0), deadline_s=1.0)["refusal"] == "deadline"
    late.advance(1.0)
    at = late.at
    late.advance(1.0)
    assert late.at == at or late.at.distance_to(at) < 0.002


def test_a_go2_that_does_not_take_commands_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    base, _, sdk = made_go2(monkeypatch)
    sdk.code = 3102
    assert finish(base, Move(0.25))["refusal"] == "fault"
    assert sdk.stops


def test_a_go2_whose_state_is_silent_has_lost_a_sensor(monkeypatch: pytest.MonkeyPatch) -> None:
    base, _, sdk = made_go2(monkeypatch)
    sdk.silent = True
    assert finish(base, Move(1.0))["refusal"] == "sensor"


def test_the_image_of_a_go2_has_the_size_of_its_jpeg(monkeypatch: pytest.MonkeyPatch) -> None:
    base, _, _ = made_go2(monkeypatch)
    image = base.colours()
    assert (image["encoding"], image["height"], image["width"]) == ("jpeg", 48, 64)


def test_a_spot_without_its_lease_is_a_fault_and_names_the_rival(monkeypatch: pytest.MonkeyPatch) -> None:
    base, _, sdk = made_spot(monkeypatch)
    sdk.owner = "the owner of the lease"
    assert finish(base, Move(0.25))["refusal"] == "fault"
    assert base.state()["rival"] == "the owner of the lease"


def test_a_spot_that_is_no_longer_commanded_stops_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    base, late, sdk = made_spot(monkeypatch)
    base.send(0.3, 0.0)
    for _ in range(100):
        sdk.advance(0.02)
    assert late.wanted == (0.0, 0.0)


@pytest.mark.parametrize("where", ["runstop", "contact"])
def test_a_stretch_reports_its_runstop_and_its_contacts(monkeypatch: pytest.MonkeyPatch, where: str) -> None:
    base, _, robot = made_stretch(monkeypatch)
    if where == "runstop":
        robot.pimu.status["runstop_event"] = True
    else:
        robot.base.left_wheel.status["in_guarded_event"] = True
    assert finish(base, Move(0.25))["refusal"] == {"runstop": "fault", "contact": "collision"}[where]


def test_a_robot_of_a_vendor_is_driven_over_the_socket(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    base, late, _ = made_stretch(monkeypatch)
    monkeypatch.setattr(stretch.Stretch, "gone_s", 30.0)
    with driven(base, tmp_path) as robot:
        monkeypatch.setattr(robot, "_settings", robot._settings.model_copy(update={"settle_s": 0.01}))
        result = robot.drive(Waypoint(0.6, 0.2), lambda _: "")
        observation = robot.observe()
    assert result.completed, result
    assert late.at.distance_to(Pose(0.3, -0.2, 2.9).compose(Pose(0.6, 0.2))) < 0.03
    assert observation.depth_m is not None
    assert float(observation.depth_m[0, 0]) == 1.5
