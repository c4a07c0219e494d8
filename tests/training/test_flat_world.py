"""Cameras and lighting of the flats of the demonstrations."""

import numpy as np

from training.flat_world import Lighting
from training.recipe import Demonstrations
from vsnbench.values.camera import Camera


def test_cameras_stay_in_their_span_and_differ_from_seed_to_seed() -> None:
    camera = Camera(width=640, height=480, horizontal_fov_deg=60, mount_height_m=0.6)
    plan = Demonstrations(mount_height_m=(0.5, 0.7), tilt_deg=(-5, 0), horizontal_fov_deg=(55, 65))
    drawn = [plan.varied(camera, seed) for seed in range(20)]
    assert len({each.mount_height_m for each in drawn}) > 15
    assert all(
        0.5 <= c.mount_height_m <= 0.7 and -5 <= c.tilt_deg <= 0 and 55 <= c.horizontal_fov_deg <= 65 for c in drawn
    )
    assert plan.varied(camera, 3) == drawn[3]


def test_lighting_changes_an_image_the_same_way_for_a_seed() -> None:
    rgb = np.full((4, 4, 3), 100, np.uint8)
    lit = [Lighting.of(seed).apply(rgb) for seed in range(8)]
    assert len({each[0, 0].tobytes() for each in lit}) == 8
    assert np.array_equal(Lighting.of(3).apply(rgb), lit[3])
