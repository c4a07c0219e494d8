"""What the recorder keeps of a step beside its images."""

import numpy as np

from vsnbench.protocol.camera import Camera
from vsnbench.protocol.observation import Observation
from vsnbench.protocol.pose import Pose
from vsnbench.runner.recorder import sensing_details

CAMERA = Camera(width=8, height=6, horizontal_fov_deg=60, mount_height_m=0.6)
RGB = np.zeros((6, 8, 3), np.uint8)


def test_how_a_look_came_about_is_kept_with_both_stamps() -> None:
    sensing = {"depth_frames": 10.0, "skew_s": 0.012, "computed_s": 0.004}
    observation = Observation(RGB, None, Pose(0, 0), 5.0, CAMERA, depth_stamp_s=4.988, sensing=sensing)
    assert sensing_details(observation) == {"sensing": {**sensing, "depth_stamp_s": 4.988}}


def test_a_look_with_nothing_to_say_leaves_no_trace() -> None:
    assert sensing_details(Observation(RGB, None, Pose(0, 0), 5.0, CAMERA)) == {}
