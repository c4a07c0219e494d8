"""Stand-in for VLFM's policy for the real robot: the same observations and answers, without detectors.

Written from bdaiinstitute/vlfm (commit 584ed56), vlfm/policy/reality_policies.py, vlfm/policy/base_objectnav_policy.py
and vlfm/reality/objectnav_env.py: it reads what they read. It looks around by arm yaws and then drives to a point,
which it names in `rho_theta` at every step as base_objectnav_policy.py:263-274 does, also with the answer that stops.
"""

import numpy as np

GOAL_XY = np.array([1.5, 0.6])
BODY_DEPTH_M, GRIPPER_DEPTH_M = 2.5, 5.0  # config/experiments/reality.yaml:24-25
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
            assert (low, high) == (0, BODY_DEPTH_M)
            assert min(fx, fy, fov) > 0
        assert observations["obstacle_map_depths"][-1][0] is None
        height, width = observations["nav_depth"].shape
        rgb, depth, _frame, low, high, _fx, _fy = observations["object_map_rgbd"][0]
        assert (low, high) == observations["value_map_rgbd"][0][3:5] == (0, GRIPPER_DEPTH_M)
        body = observations["obstacle_map_depths"][0][0]
        assert np.allclose(np.minimum(depth * GRIPPER_DEPTH_M, BODY_DEPTH_M), body * BODY_DEPTH_M, atol=1e-5)
        assert rgb.shape == (height, width, 3)
        assert len(observations["value_map_rgbd"][0]) == 6
        assert observations["robot_xy"].shape == (2,)
        assert isinstance(observations["robot_heading"], float)
        assert isinstance(observations["objectgoal"], str)
        self.steps += 1
        if self.steps <= len(YAWS):
            return {"angular": 0, "linear": 0, "arm_yaw": YAWS[self.steps - 1], "info": {}}
        return self.drive(observations["robot_xy"], observations["robot_heading"])

    def drive(self, position, heading):
        forward, left = GOAL_XY - position
        angle = np.arctan2(left, forward) - heading
        rho, theta = np.hypot(forward, left), np.arctan2(np.sin(angle), np.cos(angle))
        angular, linear = (0.0, 0.0) if rho < 0.9 else (0.3, 1.7)
        return {
            "angular": angular,
            "linear": linear,
            "arm_yaw": -1,
            "info": {},
            "rho_theta": np.array([rho, theta]),
        }


class WithoutSubGoals(RealityITMPolicyV2):
    """A policy that names no sub-goal: its two numbers are what upstream's robot drives."""

    ANSWERS = ((0.3, 1.7), (-0.5, 0.0), (1.0, 0.25), (0.0, 0.0))

    def drive(self, position, heading):
        angular, linear = self.ANSWERS[self.steps - len(YAWS) - 1]
        return {"angular": angular, "linear": linear, "arm_yaw": -1, "info": {}}
