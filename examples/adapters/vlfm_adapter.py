"""VLFM as a model: its Habitat policy with discrete actions, and its real-robot policy with velocities.

Put this file and vsnbench_policy.py into VLFM's environment, and start its detectors with
`scripts/launch_vlm_servers.sh`:

    python vsnbench_policy.py vlfm_adapter:VLFMHabitat --settings vlfm.json --port 8765
    python vsnbench_policy.py vlfm_adapter:VLFMReality --settings vlfm.json --port 8765
    vsnbench run --model ws://gpu-box:8765 --goal all

vlfm.json: {"arguments": {"pointnav_policy_path": "data/pointnav_weights.pth", "depth_image_shape": [224, 224],
"pointnav_stop_radius": 0.9, "object_map_erosion_size": 5, "text_prompt": "Seems like there is a target_object ahead."}}
and the other arguments of upstream's configuration.
"""

import importlib
import math
from typing import ClassVar

import numpy as np

HM3D = {"chair": 0, "bed": 1, "plant": 2, "toilet": 3, "monitor": 4, "sofa": 5}
NAMES = {"plant": "potted plant", "monitor": "tv", "sofa": "couch"}
ACTIONS = {0: "STOP", 1: "MOVE_FORWARD", 2: "TURN_LEFT", 3: "TURN_RIGHT"}


class _VLFM:
    """What both policies share: the policy is created for the robot's camera, and depth is normalized."""

    policy_class = ""
    card_fields: ClassVar = {}
    depth_range_m = (0.5, 5.0)

    def __init__(self, arguments, depth_range_m=None, policy_class="", device="cuda"):
        """Store the settings; the policy is created when the first episode states the camera.

        Args:
            arguments: arguments of upstream's class, except those about the camera.
            depth_range_m: depths that are 0 and 1 for the policy; upstream's own when absent.
            policy_class: `module:Class` of another of upstream's policies.
            device: device of the tensors that the policy receives.
        """
        self.arguments, self.device = arguments, device
        self.low_m, self.high_m = self.depth_range_m if depth_range_m is None else depth_range_m
        self.where = policy_class or self.policy_class
        settings = {"arguments": arguments, "depth_range_m": [self.low_m, self.high_m], "policy": self.where}
        self.card = dict(
            self.card_fields,
            name=type(self).__name__.lower(),
            sensors=["rgb", "depth", "odometry"],
            settings=settings,
            deterministic=False,  # its detectors run in other processes, on a GPU
        )
        self.policy = self.camera = self.task = None

    def reset(self, goal, seed):
        """Refuse clients of version 1 of the protocol, which send no camera."""
        raise ValueError("vlfm needs the robot's camera: use a newer vsnbench on the robot's side")

    def begin(self, task):
        """Start an episode."""
        torch = importlib.import_module("torch")
        torch.manual_seed(task.seed)
        np.random.seed(task.seed % 2**32)  # noqa: NPY002 - upstream draws from the global generator
        camera = vars(task.robot.camera)
        if self.policy is None or camera != self.camera:
            module, _, name = self.where.partition(":")
            self.policy = getattr(importlib.import_module(module), name)(**self.made_for(task.robot.camera))
            self.camera = dict(camera)
        self.task, self.is_first = task, True

    def made_for(self, camera):
        """Return the arguments of the policy."""
        return self.arguments

    def mask(self):
        """Return False at the first step of an episode, which resets upstream's policy."""
        torch = importlib.import_module("torch")
        first, self.is_first = self.is_first, False
        return torch.full((1, 1), not first, dtype=torch.bool, device=self.device)

    def depth(self, observation):
        """Return depth in [0, 1]: the minimum where it is invalid, 1 beyond the camera's range."""
        clipped = np.clip(np.nan_to_num(observation.depth_m, nan=self.low_m), self.low_m, self.high_m)
        if observation.beyond_range is not None:
            clipped[observation.beyond_range] = self.high_m
        return ((clipped - self.low_m) / (self.high_m - self.low_m)).astype(np.float32)


class VLFMHabitat(_VLFM):
    """`HabitatITMPolicyV2` and the others of `vlfm.policy.habitat_policies`."""

    policy_class = "vlfm.policy.habitat_policies:HabitatITMPolicyV2"
    card_fields: ClassVar = {"goals": sorted(HM3D), "forward_m": 0.25, "turn_deg": 30.0}

    def made_for(self, camera):
        """Return upstream's arguments with the camera's."""
        return dict(
            self.arguments,
            camera_height=camera.mount_height_m,
            min_depth=self.low_m,
            max_depth=self.high_m,
            camera_fov=camera.horizontal_fov_deg,
            image_width=camera.width,
        )

    def act(self, observation):
        """Return the policy's action."""
        torch = importlib.import_module("torch")
        tensors = importlib.import_module("habitat_baselines.common.tensor_dict")
        pose = observation.pose
        seen = {
            "rgb": observation.rgb.copy(),
            "depth": self.depth(observation)[:, :, None],
            "gps": np.array([pose.x_m, -pose.y_m], np.float32),  # Habitat's is (forward, right)
            "compass": np.array([pose.heading_rad], np.float32),
            "heading": np.array([pose.heading_rad], np.float32),
            "objectgoal": np.array([HM3D[str(self.task.goal)]], np.int64),
        }
        batch = tensors.TensorDict(
            {name: torch.from_numpy(value)[None].to(self.device) for name, value in seen.items()}
        )
        chosen = self.policy.act(batch, None, None, self.mask(), deterministic=True)
        number = int(chosen.actions.flatten()[0])
        if number not in ACTIONS:
            raise ValueError(f"VLFM answered with action {number}; another policy class has other actions")
        return {"action": ACTIONS[number], "raw_action": str(number)}


class VLFMReality(_VLFM):
    """`RealityITMPolicyV2`: velocities, and turns of the base where upstream turns the arm with the camera."""

    policy_class = "vlfm.policy.reality_policies:RealityITMPolicyV2"
    card_fields: ClassVar = {"goal_kinds": ["category", "text"], "action_kinds": ["discrete", "move", "velocity"]}
    depth_range_m = (0.0, 3.5)
    step_m, step_rad, step_s = 0.25, math.radians(30), 0.5
    """What 1.0 of the policy's answer means in upstream's environment, and the time for it."""

    def act(self, observation):
        """Return a velocity, a turn or STOP."""
        pose, camera = observation.pose, observation.camera
        focal = camera.width / 2 / math.tan(math.radians(camera.horizontal_fov_deg) / 2)
        fov, depth, frame = (
            math.radians(camera.horizontal_fov_deg),
            self.depth(observation),
            _camera_in_episode(observation),
        )
        limits = (self.low_m, self.high_m)
        goal = str(getattr(self.task.goal, "text", "") or self.task.goal)
        seen = {
            "nav_depth": np.where(depth == 0, np.float32(1), depth),  # upstream makes black far for this network only
            "robot_xy": np.array([pose.x_m, pose.y_m]),
            "robot_heading": pose.heading_rad,
            "objectgoal": NAMES.get(goal, goal),
            "obstacle_map_depths": [
                (depth, frame, *limits, focal, focal, fov),
                (None, frame, *limits, focal, focal, fov),
            ],
            "value_map_rgbd": [(observation.rgb.copy(), depth, frame, *limits, fov)],
            "object_map_rgbd": [(observation.rgb.copy(), depth, frame, *limits, focal, focal)],
        }
        answer = self.policy.get_action(seen, self.mask())
        angular, linear, arm = (float(answer[name]) for name in ("angular", "linear", "arm_yaw"))
        raw = f"angular {angular:.2f}, linear {linear:.2f}, arm {arm:.2f}"
        if arm != -1:  # upstream looks around with the arm; the direction is relative to the start
            turn = math.remainder(arm - pose.heading_rad, math.tau)
            return {"movement": {"kind": "move", "turn_rad": turn}, "raw_action": raw}
        if not angular and not linear:
            return {"action": "STOP", "raw_action": raw}
        return {"movement": self._velocity(linear, angular), "raw_action": raw}

    def _velocity(self, linear, angular):
        """Return upstream's displacement as a velocity, slower and longer on a robot that cannot drive as fast."""
        metres, radians = (float(np.clip(value, -1, 1)) for value in (linear, angular))
        metres, radians, robot = metres * self.step_m, radians * self.step_rad, self.task.robot
        longest = max(abs(metres) / robot.max_linear_m_s, abs(radians) / robot.max_angular_rad_s)
        duration_s = min(max(self.step_s, longest), 2.0)
        return {
            "kind": "velocity",
            "linear_m_s": metres / duration_s,
            "angular_rad_s": radians / duration_s,
            "duration_s": duration_s,
        }


def _camera_in_episode(observation):
    """Return the 4 x 4 pose of the camera (x forward, y left, z up) in the frame of the episode's start."""
    pose, camera = observation.pose, observation.camera
    yaw, pitch = pose.heading_rad, -math.radians(camera.tilt_deg)
    about_z = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    about_y = np.array([[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]])
    frame = np.eye(4)
    frame[:3, :3] = about_z @ about_y
    frame[:3, 3] = [pose.x_m, pose.y_m, 0] + about_z @ [camera.mount_forward_m, 0, camera.mount_height_m]
    return frame
