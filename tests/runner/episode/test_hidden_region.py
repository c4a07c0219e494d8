"""A region of the depth image that stays invalid over turns ends the episode; an object without depth never does."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.runner.stand_ins import PROFILE
from vsnbench.errors import SensorLostError
from vsnbench.protocol.parameters import DepthGuard
from vsnbench.runner.episode.camera_watch import CameraWatch
from vsnbench.runner.episode.depth_guard import Refusal, look_ahead
from vsnbench.runner.episode.hidden_region import MAX_HIDDEN_REFUSALS
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import RobotIdentity

WIDTH, HEIGHT = 64, 48
FORWARD_M = 0.1
CAMERA = PROFILE.camera.model_copy(update={"depth_min_m": 0.4, "depth_max_m": 8.0, "mount_forward_m": FORWARD_M})
GUARD = DepthGuard()
REAL = RobotIdentity(PROFILE, "ros1", simulated=False)
LEFT_HALF = np.s_[:, : WIDTH // 2]
Hidden = tuple[float, float, float]
"""An object that has no depth: first and last direction from the base's axis in degrees, and distance in metres."""


def room(heading_deg: float, hidden: tuple[Hidden, ...] = (), seed: int = 0) -> Observation:
    """Return a level camera's view of a floor and a wall at 3 m, with objects in the world that have no depth."""
    rays = CAMERA.rays(WIDTH, HEIGHT)
    with np.errstate(divide="ignore"):
        floor_m = np.where(rays.up < 0, -rays.height_m / rays.up, math.inf)
    noise_m = 0.002 * np.random.default_rng(seed).random((HEIGHT, WIDTH))
    depth_m = (np.minimum(floor_m, 3.0)[:, None] + noise_m).astype(np.float32)
    for first_deg, last_deg, distance_m in hidden:
        # The point in the middle of the object's face in each column's direction, seen from the lens.
        middle_deg = (first_deg + last_deg) / 2
        half_deg = (last_deg - first_deg) / 2
        aside = rays.left / rays.ahead[HEIGHT // 2]
        x = distance_m / np.hypot(1, aside)
        point = np.arctan2(x * aside, FORWARD_M + x)
        off_deg = np.degrees(point) + heading_deg - middle_deg
        depth_m[HEIGHT // 3 :, np.abs((off_deg + 180) % 360 - 180) <= half_deg] = np.nan
    rgb = np.random.default_rng(seed).integers(0, 255, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    return Observation(rgb, depth_m, Pose(0.0, 0.0, math.radians(heading_deg)), 0.0, CAMERA)


def without(seen: Observation, where: object) -> Observation:
    assert seen.depth_m is not None
    seen.depth_m[where] = np.nan
    return seen


def step(watch: CameraWatch, seen: Observation) -> Refusal | None:
    """Look, and try to move forward."""
    watch.look(seen)
    reading = look_ahead(seen, PROFILE.base, GUARD)
    if reading.refusal is not None:
        watch.refused(reading)
    return reading.refusal


def driven(where: object, turn_deg: float) -> tuple[SensorLostError, int]:
    """Turn a robot without depth in a part of its images until the episode ends; return why, and the refusals."""
    watch = CameraWatch(REAL, GUARD)
    for number in range(12):
        try:
            refusal = step(watch, without(room(number * turn_deg, seed=number), where))
        except SensorLostError as lost:
            return lost, number + 1
        assert refusal is Refusal.TOO_NEAR
        turn(watch, turn_deg)
    raise AssertionError("the episode has not ended")


def turn(watch: CameraWatch, turn_deg: float) -> None:
    watch.moved(MotionResult(completed=True, turn_rad=math.radians(turn_deg)))


@pytest.mark.parametrize(
    ("where", "named"),
    [
        (LEFT_HALF, "the left half"),
        (np.s_[:, WIDTH // 2 :], "the right half"),
        (np.s_[HEIGHT // 2 :, 24:40], "columns 2"),
        (np.s_[:, : 3 * WIDTH // 4], "the left 75%"),
    ],
    ids=["left", "right", "patch", "three quarters"],
)
@pytest.mark.parametrize("turn_deg", [30, -30])
def test_a_region_that_stays_invalid_over_turns_is_a_lost_sensor(where: object, named: str, turn_deg: float) -> None:
    lost, refusals = driven(where, turn_deg)
    assert lost.statement.startswith(f"{named}")
    assert "always invalid" in lost.statement
    assert MAX_HIDDEN_REFUSALS <= refusals <= 5


def test_a_band_of_rows_is_lost_once_the_robot_has_looked_to_all_sides() -> None:
    """Each direction lacks depth in the same rows: only the robot's way here shows that no obstacle hides them."""
    lost, refusals = driven(np.s_[-14:], 30)
    assert "over a turn of 270°" in lost.statement
    assert refusals == 10


def test_a_region_that_hides_the_same_pixels_in_front_of_one_object_is_only_refused() -> None:
    watch = CameraWatch(REAL, GUARD)
    for number in range(100):
        assert step(watch, without(room(0, seed=number), LEFT_HALF)) is Refusal.TOO_NEAR


def test_a_look_in_which_the_region_has_depth_begins_anew() -> None:
    watch = CameraWatch(REAL, GUARD)
    for number in range(40):
        seen = room(30 * number, seed=number)
        step(watch, without(seen, LEFT_HALF) if number % 3 else seen)
        turn(watch, 30)


@settings(max_examples=settings.default.max_examples // 4)
@example(sofas=[(43.5, 164.5, 1.0), (-112.5, 14.5, 1.0)], turns_deg=[-30, -90, -90, -30, -30, -30, -30])
@given(
    sofas=st.lists(
        st.tuples(st.floats(-180, 180), st.floats(5, 180), st.floats(0.5, 1.5)).map(
            lambda one: (one[0] - one[1] / 2, one[0] + one[1] / 2, one[2])
        ),
        min_size=1,
        max_size=2,
    ),
    turns_deg=st.lists(st.sampled_from([-30, 30, 15, -90]), min_size=1, max_size=20),
)
def test_a_black_sofa_or_a_glass_door_never_ends_an_episode(sofas: list[Hidden], turns_deg: list[float]) -> None:
    """One or two objects without depth, 5 to 180° wide, and a robot that tries to move after every turn."""
    watch = CameraWatch(REAL, GUARD)
    heading_deg = 0.0
    for number, turn_deg in enumerate(turns_deg):
        seen = room(heading_deg, tuple(sofas), seed=number)
        watch.look(seen)
        reading = look_ahead(seen, PROFILE.base, GUARD)
        if reading.refusal is Refusal.TOO_NEAR:  # three blind refusals after a turn of 180° have their own rule
            watch.refused(reading)
        turn(watch, turn_deg)
        heading_deg += turn_deg


def test_obstacles_on_three_sides_never_end_an_episode() -> None:
    """Low glass in half a circle of headings hides the same rows in every look at it."""
    watch = CameraWatch(REAL, GUARD)
    refusals = 0
    for number, heading_deg in enumerate([*range(0, 91, 15), *range(90, -91, -15), *range(-90, 91, 30)]):
        seen = without(room(heading_deg, seed=number), np.s_[-14:])
        refusals += step(watch, seen) is Refusal.TOO_NEAR
        turn(watch, 15)
    assert refusals > 20
