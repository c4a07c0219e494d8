"""The quick bound on distances: never too large, and exact for what stands upright."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import affinity
from shapely.geometry import Point, box

from tests.simulator.places import GREY, pillar
from vsnbench.simulator.dynamics.clearance import SolidDistances
from vsnbench.simulator.primitives import Primitive, Quaternion, Shape

sizes = st.floats(0.02, 1.0)
places = st.floats(-3, 3)


def about_z(angle_rad: float) -> Quaternion:
    return (math.cos(angle_rad / 2), 0.0, 0.0, math.sin(angle_rad / 2))


@settings(deadline=None)
@given(places, places, sizes, sizes, st.floats(-4, 4), places, places)
def test_the_distance_to_an_upright_box_is_exact(
    x: float, y: float, half_x: float, half_y: float, yaw: float, px: float, py: float
) -> None:
    solid = Primitive(Shape.BOX, (x, y, 0.5), (half_x, half_y, 0.5), GREY, about_z(yaw))
    shadow = affinity.translate(affinity.rotate(box(-half_x, -half_y, half_x, half_y), yaw, (0, 0), True), x, y)
    assert SolidDistances([solid], 0.0, 1.0).distance_m(px, py) == pytest.approx(
        shadow.distance(Point(px, py)), abs=1e-9
    )


quaternions = (
    st.tuples(*[st.floats(-1, 1)] * 4)
    .filter(lambda q: math.hypot(*q) > 0.1)
    .map(lambda q: (q[0] / math.hypot(*q), q[1] / math.hypot(*q), q[2] / math.hypot(*q), q[3] / math.hypot(*q)))
)


@settings(deadline=None)
@given(quaternions, st.tuples(sizes, sizes, sizes), st.tuples(*[st.floats(-1, 1)] * 3), places, places)
def test_the_distance_to_a_tilted_box_is_never_too_large(
    rotation: Quaternion,
    half_size: tuple[float, float, float],
    inside: tuple[float, float, float],
    px: float,
    py: float,
) -> None:
    """Any point of the box is at least as far as the bound says."""
    solid = Primitive(Shape.BOX, (0.3, -0.2, 0.5), half_size, GREY, rotation)
    w, *axis = rotation
    local = [share * half for share, half in zip(inside, half_size, strict=True)]
    # v + 2 r x (r x v + w v), the rotation of a vector by a unit quaternion.
    cross = [axis[(i + 1) % 3] * local[(i + 2) % 3] - axis[(i + 2) % 3] * local[(i + 1) % 3] for i in range(3)]
    inner = [cross[i] + w * local[i] for i in range(3)]
    turned = [
        local[i] + 2 * (axis[(i + 1) % 3] * inner[(i + 2) % 3] - axis[(i + 2) % 3] * inner[(i + 1) % 3])
        for i in range(3)
    ]
    distance_m = math.dist((px, py), (0.3 + turned[0], -0.2 + turned[1]))
    assert SolidDistances([solid], -9.0, 9.0).distance_m(px, py) <= distance_m + 1e-9


def test_the_nearest_of_several_counts_and_an_empty_floor_is_infinitely_free() -> None:
    assert SolidDistances([pillar(1, 0), pillar(3, 0)], 0.0, 1.0).distance_m(2.8, 0.0) == pytest.approx(0.1)
    assert SolidDistances([], 0.0, 1.0).distance_m(0.0, 0.0) == math.inf


def test_only_what_reaches_into_the_band_of_heights_is_kept() -> None:
    low, high, between = pillar(0, 0, top_m=0.02), pillar(0, 0, bottom_m=0.7, top_m=2), pillar(0, 0)
    assert SolidDistances([low, high, between], 0.03, 0.6).solids == [between]
