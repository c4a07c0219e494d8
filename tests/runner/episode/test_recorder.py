"""What the recorder stores of a step in addition to its images."""

import numpy as np

from vsnbench.runner.episode.recorder import sensing_details
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

CAMERA = Camera(width=8, height=6, horizontal_fov_deg=60, mount_height_m=0.6)
RGB = np.zeros((6, 8, 3), np.uint8)


def test_sensing_details_hold_both_stamps() -> None:
    sensing = {"depth_frames": 10.0, "skew_s": 0.012, "computed_s": 0.004}
    observation = Observation(RGB, None, Pose(0, 0), 5.0, CAMERA, depth_stamp_s=4.988, sensing=sensing)
    assert sensing_details(observation) == {"sensing": {**sensing, "depth_stamp_s": 4.988}}


def test_an_observation_without_details_adds_none() -> None:
    assert sensing_details(Observation(RGB, None, Pose(0, 0), 5.0, CAMERA)) == {}
