"""Pieces of wall in a depth image: where they lie and which way they face, whatever the camera's tilt."""

import math

import numpy as np
import pytest

from tests.scan_matching.rooms import CAMERA, depth_of
from vsnbench.protocol.pose import Pose
from vsnbench.scan_matching.wall_pieces import pieces_of

WALL = ((2.0, -5.0), (2.0, 5.0))


@pytest.mark.parametrize("tilt_deg", [0.0, -20.0, 15.0])
@pytest.mark.parametrize("heading_deg", [0.0, 35.0, -50.0])
def test_a_wall_lies_where_it_is_and_faces_who_sees_it(tilt_deg: float, heading_deg: float) -> None:
    camera = CAMERA.model_copy(update={"tilt_deg": tilt_deg})
    pose = Pose.from_degrees(0.0, 0.0, heading_deg)
    pieces = pieces_of(depth_of([WALL], pose, camera), camera)
    assert len(pieces) > 5
    ahead = pieces.points @ np.array([math.cos(pose.heading_rad), -math.sin(pose.heading_rad)])
    assert ahead == pytest.approx(2.0, abs=2e-3)
    assert np.degrees(np.cos(pieces.facing_rad + pose.heading_rad)) == pytest.approx(math.degrees(-1), abs=0.01)


def test_noise_of_a_structured_light_camera_hardly_moves_a_wall() -> None:
    depth_m = depth_of([WALL], Pose(0.0, 0.0))
    rng = np.random.default_rng(3)
    noisy = (depth_m + rng.standard_normal(depth_m.shape) * 0.002 * depth_m**2).astype(np.float32)
    pieces = pieces_of(noisy, CAMERA)
    assert np.abs(pieces.points[:, 0] - 2.0).mean() < 0.004
    assert len(pieces) > 5


def test_the_floor_and_what_is_far_or_invalid_is_no_wall() -> None:
    rays = CAMERA.rays(160, 120)
    with np.errstate(divide="ignore"):
        floor = np.where(rays.up < 0, -CAMERA.mount_height_m / rays.up, np.nan)
    assert len(pieces_of(np.repeat(floor[:, None], 160, axis=1).astype(np.float32), CAMERA)) == 0
    assert len(pieces_of(depth_of([((7.0, -9.0), (7.0, 9.0))], Pose(0.0, 0.0)), CAMERA)) == 0
    assert len(pieces_of(np.full((120, 160), np.nan, np.float32), CAMERA)) == 0
