"""Odometry from TF: links compose as matrices do, and a chain that gives no odometry is named."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vsnbench.sensing.odometry.odometry import PlanarReading
from vsnbench.sensing.odometry.transform_chain import Link, TransformChain, frame_of, pose_of

STILL = (0.0, 0.0, 0.0, 1.0)
lengths = st.floats(-50, 50)
rotations = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(part * part for part in q) > 0.3)
links = st.builds(lambda shift, turn: Link("a", "b", 1.0, shift, turn), st.tuples(lengths, lengths, lengths), rotations)


def yawed(parent: str, child: str, stamp_s: float, x_m: float, yaw_deg: float = 0.0) -> Link:
    half = math.radians(yaw_deg) / 2
    return Link(parent, child, stamp_s, (x_m, 0.0, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)))


def matrix(link: Link) -> np.ndarray:
    found = np.eye(4)
    found[:3, :3] = Rotation.from_quat(link.rotation).as_matrix()
    found[:3, 3] = link.translation_m
    return found


@given(st.lists(links, max_size=5))
def test_links_compose_as_matrices_do(chain: list[Link]) -> None:
    pose, expected = pose_of(chain, 2.0), np.linalg.multi_dot([np.eye(4), np.eye(4), *map(matrix, chain)])
    assert (pose.x_m, pose.y_m) == pytest.approx((expected[0, 3], expected[1, 3]), abs=1e-9)
    if math.hypot(expected[0, 0], expected[1, 0]) > 1e-3:
        off_rad = pose.heading_rad - math.atan2(expected[1, 0], expected[0, 0])
        assert math.remainder(off_rad, math.tau) == pytest.approx(0, abs=1e-9)
    assert pose.stamp_s == 2.0


@given(st.permutations(range(3)))
def test_fixed_links_may_come_in_any_order(order: list[int]) -> None:
    fixed = [yawed("a", "b", 0, 1), yawed("b", "c", 0, 1, 90), yawed("c", "base", 0, 1)]
    chain = TransformChain("odom", "base")
    for number in order:
        assert chain.add([fixed[number]], fixed=True) is None
    pose = chain.add([yawed("odom", "a", 7.0, 10, 90)], fixed=False)
    assert pose is not None
    assert (pose.x_m, pose.y_m, pose.stamp_s) == pytest.approx((9.0, 2.0, 7.0))
    assert abs(pose.heading_rad) == pytest.approx(math.pi)
    assert chain.fault() == ""


def test_only_a_new_stamp_of_the_odometry_gives_a_pose() -> None:
    chain = TransformChain("odom", "base")
    assert chain.add([yawed("odom", "base", 1.0, 0.5)], fixed=False) == PlanarReading(0.5, 0.0, 0.0, 1.0)
    assert chain.add([yawed("odom", "base", 1.0, 0.6)], fixed=False) is None
    assert chain.add([yawed("base", "camera", 2.0, 0.1)], fixed=False) is None
    assert chain.add([yawed("odom", "base", 2.0, 0.6)], fixed=False) == PlanarReading(0.6, 0.0, 0.0, 2.0)


def test_a_silent_moving_link_ends_the_odometry() -> None:
    chain = TransformChain("odom", "base")
    chain.add([yawed("foot", "base", 1.0, 0.1)], fixed=False)
    assert chain.add([yawed("odom", "foot", 1.9, 0.1)], fixed=False) is not None
    assert chain.add([yawed("odom", "foot", 2.1, 0.1)], fixed=False) is None
    assert chain.fault() == "TF: foot to base is 1.1 s older than odom to foot"


def test_an_invalid_rotation_makes_the_heading_nan() -> None:
    pose = pose_of([Link("odom", "base", 1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))], 1.0)
    assert math.isnan(pose.heading_rad)


@pytest.mark.parametrize(
    ("seen", "says"),
    [
        ([], "TF does not connect odom to base: odom has no parent, base has no parent; no link seen"),
        ([("map", "odom"), ("foot", "base"), ("trunk", "foot")], "odom has parent map, base has parents foot, trunk"),
        ([("base", "foot"), ("foot", "odom")], "TF connects odom below base, not above it"),
        ([("foot", "base"), ("base", "foot")], "base has parent foot"),
    ],
)
def test_frames_that_do_not_connect_are_named_with_their_parents(seen: list[tuple[str, str]], says: str) -> None:
    chain = TransformChain("odom", "base")
    assert chain.add([yawed(parent, child, 1.0, 0.0) for parent, child in seen], fixed=False) is None
    assert says in chain.fault()


def test_a_base_that_is_fixed_to_the_odometry_frame_has_no_odometry() -> None:
    chain = TransformChain("odom", "base")
    assert chain.add([yawed("odom", "base", 0.0, 0.0)], fixed=True) is None
    assert "is fixed" in chain.fault()


def test_frames_of_a_hostile_name_stay_one_bounded_line() -> None:
    chain = TransformChain("odom", "base")
    chain.add([yawed(f"a\n\x1b[31m{'x' * 500}", "base", 1.0, 0.0)], fixed=False)
    assert chain.fault().isprintable()
    assert len(chain.fault()) < 300


def test_a_leading_slash_of_the_older_tf_is_dropped() -> None:
    assert (frame_of("/odom"), frame_of("robot1/odom")) == ("odom", "robot1/odom")
