"""The attitude of a base comes from its odometry or an IMU; what has none is named in one line."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from vsnbench.robots.profiles import load_profile
from vsnbench.ros.common.interface import AttitudeSource
from vsnbench.ros.common.messages import fill_orientation
from vsnbench.ros.common.odometry import OdometryReader
from vsnbench.ros.ros2.interface import Ros2Interface, ros2_interface
from vsnbench.sensing.images.camera_images import Stamped
from vsnbench.sensing.odometry.attitude import AttitudeReader, attitude_at
from vsnbench.sensing.odometry.odometry import heading_of_quaternion
from vsnbench.values.pose import Attitude

LEANING = Attitude(math.radians(-3), math.radians(8))


def quaternion(attitude: Attitude, heading_rad: float = 0.0) -> tuple[float, float, float, float]:
    """Return x, y, z, w by the products of the three turns."""
    (cr, sr), (cp, sp), (cy, sy) = (
        (math.cos(angle / 2), math.sin(angle / 2)) for angle in (attitude.roll_rad, attitude.pitch_rad, heading_rad)
    )
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def imu(
    reader: AttitudeReader,
    attitude: Attitude,
    force: Any = None,
    frame: str = "base_link",
    has_orientation: bool = True,
) -> Attitude | str:
    """Return what the reader makes of a second of equal messages."""
    upward = tuple(9.81 * attitude.rotation[2]) if force is None else force
    for number in range(20):
        read = reader.read_imu(quaternion(attitude), upward, 0.05 * number, frame, has_orientation=has_orientation)
    return read


def reader() -> AttitudeReader:
    return AttitudeReader("/imu", "base_link")


@pytest.mark.parametrize("heading_rad", [0.0, 2.0, -3.0])
def test_roll_and_pitch_of_an_orientation_do_not_depend_on_its_heading(heading_rad: float) -> None:
    read = reader().read(quaternion(LEANING, heading_rad))
    assert isinstance(read, Attitude)
    assert read.turned_from(LEANING) < 1e-9


def test_a_simulated_robot_publishes_heading_and_attitude_in_one_orientation() -> None:
    turn = SimpleNamespace()
    fill_orientation(turn, 2.0, LEANING)
    assert heading_of_quaternion(turn.x, turn.y, turn.z, turn.w) == pytest.approx(2.0)
    assert Attitude.of_quaternion(turn.x, turn.y, turn.z, turn.w).turned_from(LEANING) < 1e-9


def test_an_imu_with_gravity_in_the_frame_of_the_base_is_read() -> None:
    read = imu(reader(), LEANING)
    assert isinstance(read, Attitude)
    assert read.turned_from(LEANING) < 1e-9


@pytest.mark.parametrize(
    ("read", "words"),
    [
        (lambda: reader().read((0.0, 0.0, 0.0, 0.0)), "(0, 0, 0, 0) is not a unit quaternion"),
        (lambda: reader().read((0.0, 0.0, 0.6, 0.9)), "not a unit quaternion"),
        (lambda: reader().read((math.nan, 0.0, 0.0, 1.0)), "not a unit quaternion"),
        (lambda: reader().read((1.0, 0.0, 0.0, 0.0)), "leans by 180°"),
        (lambda: imu(reader(), LEANING, force=(0.0, 0.0, 0.02)), "is 0.02 m/s², not 9.81"),
        (lambda: imu(reader(), LEANING, force=(0.0, 0.0, 1.0)), "is 1.00 m/s², not 9.81"),
        (lambda: imu(reader(), LEANING, force=(math.nan, 0.0, 9.81)), "is nan m/s², not 9.81"),
        (lambda: imu(reader(), Attitude(), force=(9.81, 0.0, 0.0)), "90° apart"),
        (lambda: imu(reader(), LEANING, frame="imu_link"), "in the frame imu_link, not in base_link"),
        (lambda: imu(reader(), LEANING, has_orientation=False), "has no orientation"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_is_no_attitude_is_named_in_one_line(read: Any, words: str) -> None:
    fault = read()
    assert isinstance(fault, str)
    assert words in fault
    assert "\n" not in fault
    assert "/imu" in fault


def test_the_attitude_at_an_image_lies_between_its_neighbours_and_is_unknown_far_from_them() -> None:
    measured = [Stamped(Attitude(0.0, 0.1 * number), 10 + 0.02 * number, 0.0) for number in range(3)]
    between = attitude_at(measured, 10.03)
    assert between is not None
    assert between.pitch_rad == pytest.approx(0.15)
    assert attitude_at(measured, 10.1) == measured[-1].payload
    assert attitude_at(measured, 10.2) is None
    assert attitude_at([], 10.0) is None


class Reader(OdometryReader[str]):
    """A reader of messages whose stamps are numbers."""

    def __init__(self, names: Ros2Interface) -> None:
        self.attitudes: list[Any] = []
        super().__init__(names, lambda *_reading: None, lambda *measured: self.attitudes.append(measured))

    def _seconds(self, stamp: float) -> float:
        return stamp


def odometry(turn: tuple[float, float, float, float]) -> SimpleNamespace:
    orientation = SimpleNamespace(**dict(zip("xyzw", turn, strict=True)))
    pose = SimpleNamespace(position=SimpleNamespace(x=1.0, y=2.0), orientation=orientation)
    return SimpleNamespace(header=SimpleNamespace(stamp=5.0), pose=SimpleNamespace(pose=pose))


def with_attitude(topic: str) -> Ros2Interface:
    content = load_profile("turtlebot4").interface
    assert content is not None
    given = Ros2Interface.model_validate(content.model_dump() | {"attitude": {"topic": topic}})
    return given.resolved()


@pytest.mark.parametrize(("topic", "count"), [("odom", 1), ("imu/data", 0)])
def test_odometry_has_the_attitude_only_where_the_profile_names_its_topic(topic: str, count: int) -> None:
    read = Reader(with_attitude(topic))
    read.take_odometry(odometry(quaternion(LEANING, 1.0)), "/base")
    assert len(read.attitudes) == count
    assert bool(read.imu) == (count == 0)


def test_a_message_of_an_imu_is_read_with_its_frame_and_its_covariance() -> None:
    read = Reader(with_attitude("imu/data"))
    turn = SimpleNamespace(**dict(zip("xyzw", quaternion(LEANING), strict=True)))
    header, force = SimpleNamespace(stamp=1.0, frame_id="imu_link"), SimpleNamespace(x=0.0, y=0.0, z=9.81)
    message = SimpleNamespace(
        header=header, orientation=turn, linear_acceleration=force, orientation_covariance=[0.0] * 9
    )
    read.take_imu(message)
    header.frame_id = "/base_link"
    read.take_imu(message)
    message.orientation_covariance = [-1.0, *[0.0] * 8]
    read.take_imu(message)
    kinds = [type(measured) for measured, _ in read.attitudes]
    assert kinds == [str, Attitude, str]


def test_a_profile_without_a_source_keeps_its_hash_and_has_no_attitude() -> None:
    names = ros2_interface(load_profile("turtlebot4"))
    assert "attitude" not in names.model_dump()
    assert isinstance(AttitudeSource(topic="odom").frame, str)
    read = Reader(names)
    read.take_odometry(odometry(quaternion(LEANING)), "/base")
    assert read.attitudes == []
