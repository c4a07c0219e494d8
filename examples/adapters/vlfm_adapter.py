"""VLFM as a model: its Habitat policy with discrete actions, and its real-robot policy with sub-goals.

Put this file and vsnbench_policy.py into VLFM's environment, and start its detectors with
`scripts/launch_vlm_servers.sh`:

    python vsnbench_policy.py vlfm_adapter:VLFMHabitat --settings vlfm.json --port 8765
    python vsnbench_policy.py vlfm_adapter:VLFMReality --settings vlfm.json --port 8765
    vsnbench run --model ws://gpu-box:8765 --goal all

vlfm.json: {"arguments": {"pointnav_policy_path": "data/pointnav_weights.pth", "depth_image_shape": [224, 224],
"pointnav_stop_radius": 0.9, "object_map_erosion_size": 5, "text_prompt": "Seems like there is a target_object ahead."}}
and the other arguments of upstream's configuration. Lines of upstream are those of bdaiinstitute/vlfm at 584ed56.
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
    camera: ClassVar = {"mount_height_m": 0.88, "tilt_deg": 0, "horizontal_fov_deg": 79, "width": 640, "height": 480}
    """Camera with which the network for point goals was trained (config/tasks/pointnav_depth_hm3d.yaml:21-27)."""

    def __init__(self, arguments, policy_class, device, **settings):
        """Store the settings; the policy is created when the first episode states the camera."""
        self.arguments, self.device = arguments, device
        self.where = policy_class or self.policy_class
        self.card = dict(
            self.card_fields,
            name=type(self).__name__.lower(),
            sensors=["rgb", "depth", "odometry"],
            settings=dict(settings, arguments=arguments, policy=self.where),
            camera=self.camera,
            deterministic=False,  # its detectors run in other processes, on a GPU
        )
        self.policy = self.made_for_camera = self.task = None

    def reset(self, goal, seed):
        """Refuse an episode without a task, which has no camera."""
        raise ValueError("vlfm needs the robot's camera: use a newer vsnbench on the robot's side")

    def begin(self, task):
        """Start an episode."""
        torch = importlib.import_module("torch")
        torch.manual_seed(task.seed)
        np.random.seed(task.seed % 2**32)  # noqa: NPY002 - upstream draws from the global generator
        camera = vars(task.robot.camera)
        if self.policy is None or camera != self.made_for_camera:
            module, _, name = self.where.partition(":")
            self.policy = getattr(importlib.import_module(module), name)(**self.made_for(task.robot.camera))
            self.made_for_camera = dict(camera)
        self.task, self.is_first = task, True

    def made_for(self, camera):
        """Return the arguments of the policy."""
        return self.arguments

    def mask(self):
        """Return False at the first step of an episode, which resets upstream's policy."""
        torch = importlib.import_module("torch")
        first, self.is_first = self.is_first, False
        return torch.full((1, 1), not first, dtype=torch.bool, device=self.device)

    @staticmethod
    def depth(observation, low_m, high_m):
        """Return depth in [0, 1]: the minimum where it is invalid, 1 beyond the camera's range."""
        clipped = np.clip(np.nan_to_num(observation.depth_m, nan=low_m), low_m, high_m)
        if observation.beyond_range is not None:
            clipped[observation.beyond_range] = high_m
        return ((clipped - low_m) / (high_m - low_m)).astype(np.float32)


class VLFMHabitat(_VLFM):
    """`HabitatITMPolicyV2` and the others of `vlfm.policy.habitat_policies`."""

    policy_class = "vlfm.policy.habitat_policies:HabitatITMPolicyV2"
    card_fields: ClassVar = {"goals": sorted(HM3D), "forward_m": 0.25, "turn_deg": 30.0}

    def __init__(self, arguments, depth_range_m=(0.5, 5.0), policy_class="", device="cuda"):
        """Store the settings.

        Args:
            arguments: arguments of upstream's class, except those about the camera.
            depth_range_m: depths that are 0 and 1 for the policy; by default upstream's.
            policy_class: `module:Class` of another of upstream's policies.
            device: device of the tensors that the policy receives.
        """
        self.low_m, self.high_m = depth_range_m
        super().__init__(arguments, policy_class, device, depth_range_m=[self.low_m, self.high_m])

    def begin(self, task):
        """Start an episode with one of the six goals that the policy has numbers for."""
        if str(task.goal) not in HM3D:
            raise ValueError(f"VLFM's Habitat policy does not know {str(task.goal)!r:.60}; it knows {', '.join(HM3D)}")
        super().begin(task)

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
            "depth": self.depth(observation, self.low_m, self.high_m)[:, :, None],
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
    """`RealityITMPolicyV2`: drives to sub-goals, and turns the base where upstream turns the arm with the camera.

    Upstream's robot has depth cameras on the body and a camera on the gripper; here one camera has both roles.
    """

    policy_class = "vlfm.policy.reality_policies:RealityITMPolicyV2"
    card_fields: ClassVar = {"goal_kinds": ["category", "text"], "action_kinds": ["discrete", "move", "waypoint"]}
    step_m, step_rad = 0.2, 0.523599
    """What 1.0 of `linear` and `angular` means (config/experiments/reality.yaml:26-27)."""

    def __init__(
        self, arguments, body_depth_m=2.5, gripper_depth_m=5.0, horizon_m=0.21, policy_class="", device="cuda"
    ):
        """Store the settings.

        Args:
            arguments: arguments of upstream's class.
            body_depth_m: depth that is 1 for obstacles and for driving (config/experiments/reality.yaml:24).
            gripper_depth_m: depth that is 1 for objects and values (config/experiments/reality.yaml:25).
            horizon_m: length that the robot drives towards a sub-goal before the policy decides again; null drives to
                the sub-goal. Upstream's robot walks on while the policy decides: at most 0.3 m/s
                (vlfm/reality/pointnav_env.py:89) for 0.7 s (config/experiments/reality.yaml:28).
            policy_class: `module:Class` of another of upstream's policies.
            device: device of the tensors that the policy receives.
        """
        self.body_m, self.gripper_m, self.horizon_m = body_depth_m, gripper_depth_m, horizon_m
        settings = {"body_depth_m": body_depth_m, "gripper_depth_m": gripper_depth_m, "horizon_m": horizon_m}
        super().__init__(arguments, policy_class, device, **settings)

    def act(self, observation):
        """Return a movement or STOP."""
        pose, camera = observation.pose, observation.camera
        focal = camera.width / 2 / math.tan(math.radians(camera.horizontal_fov_deg) / 2)
        fov, frame, rgb = math.radians(camera.horizontal_fov_deg), _camera_in_episode(observation), observation.rgb
        body, gripper = (self.depth(observation, 0.0, high_m) for high_m in (self.body_m, self.gripper_m))
        goal = str(getattr(self.task.goal, "text", "") or self.task.goal)
        seen = {
            "nav_depth": np.where(body == 0, np.float32(1), body),  # upstream makes black far for this network only
            "robot_xy": np.array([pose.x_m, pose.y_m]),
            "robot_heading": pose.heading_rad,
            "objectgoal": NAMES.get(goal, goal),
            "obstacle_map_depths": [
                (body, frame, 0.0, self.body_m, focal, focal, fov),
                (None, frame, 0.0, self.body_m, focal, focal, fov),
            ],
            "value_map_rgbd": [(rgb.copy(), gripper, frame, 0.0, self.gripper_m, fov)],
            "object_map_rgbd": [(rgb.copy(), gripper, frame, 0.0, self.gripper_m, focal, focal)],
        }
        answer = self.policy.get_action(seen, self.mask())
        angular, linear, arm = (float(answer[name]) for name in ("angular", "linear", "arm_yaw"))
        raw = f"angular {angular:.2f}, linear {linear:.2f}, arm {arm:.2f}"
        if arm != -1:  # upstream looks around with the arm; the direction is relative to the start
            return {"movement": _turn(math.remainder(arm - pose.heading_rad, math.tau)), "raw_action": raw}
        if not angular and not linear:  # vlfm/reality/pointnav_env.py:67, with a sub-goal too
            return {"action": "STOP", "raw_action": raw}
        if "rho_theta" in answer:  # it replaces the two numbers (vlfm/reality/pointnav_env.py:70-73)
            rho, theta = (float(value) for value in answer["rho_theta"])
            return self._towards(rho, theta, pose, raw)
        # Upstream waits until the base has arrived (vlfm/reality/pointnav_env.py:56-64, 75-94).
        metres, radians = self.step_m * _clipped(linear), self.step_rad * _clipped(angular)
        if not metres:
            return {"movement": _turn(radians), "raw_action": raw}
        movement = {"kind": "waypoint", "x_m": metres, "y_m": 0.0, "heading_rad": radians}
        return {"movement": movement, "raw_action": raw}

    def _towards(self, rho, theta, pose, raw):
        """Return the way to a sub-goal at a distance and a direction, as far as the horizon."""
        length = min(rho, 5.0 if self.horizon_m is None else self.horizon_m)  # a waypoint is at most 5 m away
        point = {"x_m": length * math.cos(theta), "y_m": length * math.sin(theta)}
        bearing = pose.heading_rad + theta
        sub_goal = [pose.x_m + rho * math.cos(bearing), pose.y_m + rho * math.sin(bearing)]
        return {
            "movement": dict(point, kind="waypoint", heading_rad=math.remainder(theta, math.tau)),
            "raw_action": f"{raw}, rho {rho:.2f}, theta {theta:.2f}",
            "diagnostics": {"sub_goal": sub_goal},
        }


def _clipped(value):
    return min(max(value, -1.0), 1.0)


def _turn(radians):
    return {"kind": "move", "turn_rad": radians}


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
