"""A policy receives copies of an observation's sensors that are on its card."""

import copy
import pickle
from dataclasses import fields, replace

import numpy as np
import numpy.typing as npt
import pytest

from vsnbench.errors import SensorLostError, SensorNotDeclaredError
from vsnbench.values.camera import Camera
from vsnbench.values.observation import ArraySpec, InstanceImage, Observation, Sensor, shown_to_policy, with_changes
from vsnbench.values.pose import Pose

CAMERA = Camera(width=64, height=48, horizontal_fov_deg=60, mount_height_m=0.6)
ALL = frozenset(Sensor)


def robots_own(*, depth: bool = True) -> Observation:
    return Observation(
        rgb=np.full((48, 64, 3), 7, np.uint8),
        depth_m=np.full((48, 64), 2.0, np.float32) if depth else None,
        pose=Pose(1.0, 2.0, 0.5),
        stamp_s=3.0,
        camera=CAMERA,
        instances=InstanceImage(np.ones((48, 64), np.int32), {1: "sofa"}),
        depth_stamp_s=2.9,
        sensing={"frames": 3.0},
    )


@pytest.mark.parametrize("sensor", list(Sensor))
def test_a_policy_sees_the_sensor_on_its_card_and_no_other(sensor: Sensor) -> None:
    shown = shown_to_policy(robots_own(), frozenset({sensor}))
    assert shown.sensors == {sensor}
    assert (shown.stamp_s, shown.camera) == (3.0, CAMERA)
    for other in ALL - {sensor}:
        with pytest.raises(SensorNotDeclaredError, match=rf"add Sensor\.{other.name} to the card's sensors"):
            getattr(shown, other.field)
        assert not hasattr(shown, other.field)
    assert shown.sensing == {}
    assert (shown.depth_stamp_s is None) is (sensor is not Sensor.DEPTH)


def test_a_policys_arrays_are_read_only_copies() -> None:
    own = robots_own()
    shown = shown_to_policy(own, ALL)
    assert shown.depth_m is not None
    assert shown.instances is not None
    with pytest.raises(ValueError, match="read-only"):
        np.nan_to_num(shown.depth_m, copy=False, nan=10)
    assert not shown.instances.ids.flags.writeable
    for array in (shown.rgb, shown.depth_m):
        array.flags.writeable = True
        array[:] = 0
    object.__setattr__(shown.pose, "x_m", 9.0)
    object.__setattr__(shown.camera, "depth_max_m", 0.0)
    assert own.depth_m is not None
    assert (own.rgb.min(), own.depth_m.min()) == (7, 2.0)
    assert own.pose == Pose(1.0, 2.0, 0.5)
    assert own.camera.depth_max_m == 10.0


def test_arrays_that_are_views_of_larger_ones_are_shown_whole_and_contiguous() -> None:
    wide = np.arange(48 * 128 * 3, dtype=np.uint32).reshape(48, 128, 3).astype(np.uint8)
    shown = shown_to_policy(Observation(wide[:, ::2], None, Pose(0, 0), 0.0, CAMERA), frozenset({Sensor.RGB}))
    assert shown.rgb.flags.c_contiguous
    assert shown.rgb.base is None
    np.testing.assert_array_equal(shown.rgb, wide[:, ::2])


def test_each_sensor_has_a_field_of_its_own() -> None:
    names = [sensor.field for sensor in Sensor]
    assert len(set(names)) == len(names)
    assert set(names) <= {item.name for item in fields(Observation)}


RANGES = ArraySpec(np.float32, ("rows", 3), span=(0, 1))


@pytest.mark.parametrize(
    ("values", "fits"),
    [
        (np.zeros((5, 3), np.float32), True),
        (np.zeros((5, 4), np.float32), False),
        (np.zeros(3, np.float32), False),
        (np.zeros((5, 3)), False),
        (np.zeros((5, 3), ">f4"), False),
        (np.full((5, 3), np.nan, np.float32), False),
    ],
)
def test_an_array_has_the_form_that_its_sensor_declares(values: npt.NDArray[np.generic], fits: bool) -> None:
    assert RANGES.fits(values) is fits
    assert replace(RANGES, nan="no echo").fits(np.full((2, 3), np.nan, np.float32))


@pytest.mark.parametrize("field", ["rgb", "depth_m"])
def test_an_observation_with_an_array_of_another_form_is_refused(field: str) -> None:
    with pytest.raises(ValueError, match=field):
        with_changes(robots_own(), **{field: np.zeros((48, 64, 2), np.float32)})


def test_a_missing_measurement_is_a_lost_sensor() -> None:
    with pytest.raises(SensorLostError, match="needs depth"):
        shown_to_policy(robots_own(depth=False), frozenset({Sensor.RGB, Sensor.DEPTH}))


@pytest.mark.parametrize("travel", [copy.deepcopy, lambda shown: pickle.loads(pickle.dumps(shown))])
def test_a_policys_observation_can_be_pickled(travel: object) -> None:
    assert callable(travel)
    shown = travel(shown_to_policy(robots_own(), frozenset({Sensor.RGB, Sensor.ODOMETRY})))
    assert shown.sensors == {Sensor.RGB, Sensor.ODOMETRY}
    assert repr(shown) == "Observation(odometry, rgb at 3.000 s)"
    with pytest.raises(SensorNotDeclaredError):
        _ = shown.depth_m
