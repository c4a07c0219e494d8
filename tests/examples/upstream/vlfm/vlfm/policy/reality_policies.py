"""Stand-in for VLFM's policy for the real robot: the same observations and answers, without detectors.

Written from bdaiinstitute/vlfm (commit 584ed56), vlfm/policy/reality_policies.py and vlfm/reality/objectnav_env.py: it
reads what they read. It looks around by arm yaws, as upstream's does, drives a curve and stops.
"""

import numpy as np

YAWS = np.deg2rad([-90, -60, -30, 0, 30, 60, 90, 0]).tolist()


class RealityITMPolicyV2:
    def __init__(self, **arguments):
        assert {"pointnav_policy_path", "depth_image_shape", "text_prompt"} <= set(arguments)
        self.steps = 0

    def get_action(self, observations, masks, deterministic=True):
        if masks[0] == 0:
            self.steps = 0
        for depth, frame, low, high, fx, fy, fov in observations["obstacle_map_depths"][:-1]:
            assert depth.ndim == 2
            assert frame.shape == (4, 4)
            assert min(high - low, fx, fy, fov) > 0
        assert observations["obstacle_map_depths"][-1][0] is None
        height, width = observations["nav_depth"].shape
        rgb, depth, _frame, _low, _high, _fx, _fy = observations["object_map_rgbd"][0]
        assert rgb.shape == (height, width, 3)
        assert len(observations["value_map_rgbd"][0]) == 6
        assert observations["robot_xy"].shape == (2,)
        assert isinstance(observations["robot_heading"], float)
        assert isinstance(observations["objectgoal"], str)
        self.steps += 1
        if self.steps <= len(YAWS):
            return {"angular": 0, "linear": 0, "arm_yaw": YAWS[self.steps - 1], "info": {}}
        speeds = (0.3, 1.7) if self.steps < 12 else (0.0, 0.0)
        return {"angular": speeds[0], "linear": speeds[1], "arm_yaw": -1, "info": {}}
