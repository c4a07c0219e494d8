"""NavDP and its benchmark's other models (InternRobotics): an HTTP server plans, the robot drives along the trajectory.

Start one of the servers in NavDP/baselines, then this file next to vsnbench_policy.py. It needs numpy and pillow:

    python navdp_server.py --port 8888 --checkpoint navdp.ckpt          # in NavDP/baselines/navdp
    python vsnbench_policy.py navdp_adapter:NavDP --port 8765
    vsnbench run --model ws://127.0.0.1:8765 --site examples/goals.yaml --goal photo-bed

The settings {"algo": "nomad"} are for another server. MODES has each server's goals: with "image" a photograph or a
route, with "point" a point, with "nogoal" the model explores and never stops, whatever the goal is. Lines of upstream
are those of InternRobotics/NavDP at commit cb33ff8.
"""

import io
import json
import math
import urllib.error
import urllib.request
import uuid
from typing import ClassVar

import numpy as np
from PIL import Image

DEPTH_UNITS_PER_METRE = 10000.0
"""The server reads depth as 16-bit PNG of tenths of a millimetre; 0 where there is none."""
LOADING_S = 55.0
"""Time limit of a reset: the servers load their networks with the first one (gnm_server.py:31-36)."""
TURN_RAD = math.radians(30)
"""A turn as a waypoint, the size of a discrete one."""
MODES = {
    "navdp": ("image", "point", "nogoal"),
    "gnm": ("image", "nogoal"),
    "vint": ("image", "nogoal"),
    "nomad": ("image", "nogoal"),
    "iplanner": ("point",),
    "viplanner": ("point",),
    "ddppo": ("point",),
}
"""What a server calls itself, and the goals that it has a route for; the first is the default."""
GOAL_KINDS = {"image": ["image", "route"], "point": ["point"], "nogoal": ["category", "text"]}
NEVER_STOP = ("iplanner", "viplanner")
"""Planners of a way to a point; in upstream's evaluation the simulator says that the robot has arrived."""
ARRIVED_M = 0.5
"""Distance to a point at which those stop here, as ViPlanner's ROS node does (`conv_dist`; iPlanner's: 0.25)."""


class NavDP:
    """Asks a server for a trajectory at every step. The server has one robot: serve one session."""

    urls: ClassVar = set()
    """Servers that this process uses."""

    def __init__(
        self,
        url="http://127.0.0.1:8888",
        mode="",
        horizon_m=1.0,
        stop_threshold=-3.0,
        weights_label="",
        timeout_s=8.0,
        turns="discrete",
        algo="navdp",
    ):
        """Set the model up.

        Args:
            url: address of the server.
            mode: `image` for photographs and routes, `point`, or `nogoal` to explore; by default the first that the
                server has.
            horizon_m: length that the robot drives before it asks again.
            stop_threshold: NavDP turns on the spot if its critic values all trajectories below this; -3 as in
                upstream's evaluations (eval_imagegoal_wheeled.py:12).
            weights_label: description of the server's checkpoint, which it does not tell.
            timeout_s: time limit of a request.
            turns: `discrete`, or `waypoint` for `vsnbench run --continuous`, where a turn must replace a path.
            algo: what the server calls itself, a key of MODES.
        """
        if algo not in MODES:
            raise ValueError(f"algo must be one of {', '.join(MODES)}")
        mode = mode or MODES[algo][0]
        if turns not in ("discrete", "waypoint"):
            raise ValueError("turns must be discrete or waypoint")
        if mode not in MODES[algo]:
            raise ValueError(f"mode of {algo} must be {' or '.join(MODES[algo])}")
        if not url.startswith(("http://", "https://")):
            raise ValueError("url must begin with http:// or https://")
        if url in self.urls:
            raise ValueError(f"the server at {url} keeps the images of one robot: serve one session")
        self.urls.add(url)
        self.url, self.mode, self.timeout_s = url.rstrip("/"), mode, timeout_s
        self.algo, self.horizon_m, self.stop_threshold = algo, horizon_m, stop_threshold
        settings = {"mode": mode}
        if algo != "ddppo":
            settings["horizon_m"] = horizon_m
        if algo == "navdp":
            settings["stop_threshold"] = stop_threshold
        if algo in NEVER_STOP:
            settings["arrived_m"] = ARRIVED_M
        self.card = {
            "name": algo,
            "sensors": ["rgb", "depth", *(["odometry"] if mode == "point" else [])],
            "goal_kinds": GOAL_KINDS[mode],
            "action_kinds": ["discrete", "trajectory", *([turns] if turns != "discrete" else [])],
            "weights_label": weights_label,
            "settings": settings,
            # The camera of upstream's evaluations (configs/robots/dingo_config.py:48-58): 2 atan(1.88 / (2 * 1.4)).
            "camera": {"horizontal_fov_deg": 67.8, "width": 640, "height": 360},
            "deterministic": False,  # diffusion or samples from the server's own random numbers, or a GPU
        }
        if algo == "ddppo":  # the steps that the checkpoint was trained with (bdaiinstitute/vlfm at 584ed56,
            # config/tasks/pointnav_depth_hm3d.yaml); the server draws each as a line of a metre
            self.card.update(action_kinds=["discrete"], forward_m=0.25, turn_deg=30.0)
        self.goals, self.point, self.turns = [], None, turns

    def begin(self, task):
        """Start an episode: the server forgets the images of the last one."""
        self.goals = list(task.goal.images) if task.goal.kind == "route" else [task.goal.image]
        self.point = task.goal.point
        camera = task.robot.camera
        focal = camera.width / 2 / math.tan(math.radians(camera.horizontal_fov_deg) / 2)
        intrinsic = [[focal, 0.0, camera.width / 2], [0.0, focal, camera.height / 2], [0.0, 0.0, 1.0]]
        request = {"intrinsic": intrinsic, "stop_threshold": self.stop_threshold, "batch_size": 1}
        # GNM, ViNT and NoMaD keep the last episode's images after a second `navigator_reset` (gnm_server.py:31-37).
        for route, content in (("navigator_reset", request), ("navigator_reset_env", {"env_id": 0})):
            answer = self._post(route, json.dumps(content).encode(), "application/json", LOADING_S)
            if answer.get("algo") != self.algo:  # all servers have these routes
                found = f"the server at {self.url} is that of {answer.get('algo')!r:.40}, not of {self.algo!r}"
                raise ValueError(f"{found}: set `algo`, or start the other server")

    def reset(self, goal, seed):
        """Refuse an episode without a task, which has no camera."""
        raise ValueError("navdp needs the robot's camera: use a newer vsnbench on the robot's side")

    def act(self, observation):
        """Return the beginning of the trajectory that the server plans, a turn, or STOP."""
        ahead_m, left_m = _in_robot_frame(self.point, observation.pose) if self.mode == "point" else (0.0, 0.0)
        if self.algo in NEVER_STOP and math.hypot(ahead_m, left_m) < ARRIVED_M:
            return {"action": "STOP", "raw_action": f"{math.hypot(ahead_m, left_m):.2f} m left"}
        path, found = self._plan(observation, ahead_m, left_m)
        while self.mode == "image" and not path.any() and len(self.goals) > 1:
            self.goals.pop(0)  # arrived at this photograph of a route
            path, found = self._plan(observation, ahead_m, left_m)
        if path[:, 0].any():
            if self.algo == "ddppo":
                return dict(found, action="MOVE_FORWARD")
            return dict(found, movement={"kind": "trajectory", "points": until(path, self.horizon_m).tolist()})
        # No way forward. For a goal, zeros mean "arrived": NavDP zeroes a trajectory that ends under 0.5 m
        # (policy_network.py:149-150), GNM, ViNT and NoMaD one to a goal of at most 7 images away (gnm_agent.py:78-79),
        # and DD-PPO's STOP is zeros (pointnav_server.py:122). NavDP moves a point behind the robot to its side
        # (policy_agent.py:125-128), so that zeros do not mean "arrived" there. Where NavDP's critic refuses all
        # trajectories, x is 0 and y the side to turn to (policy_agent.py:203-205); so are DD-PPO's turns.
        is_zero, is_behind = not path[:, 1].any(), self.algo == "navdp" and ahead_m < 0
        if is_zero and self.mode != "nogoal" and not is_behind:
            return dict(found, action="STOP")
        is_left = left_m > 0 if is_zero else path[-1, 1] > 0
        if self.turns == "waypoint" and self.algo != "ddppo":
            turn_rad = TURN_RAD if is_left else -TURN_RAD
            return dict(found, movement={"kind": "waypoint", "x_m": 0.0, "y_m": 0.0, "heading_rad": turn_rad})
        return dict(found, action="TURN_LEFT" if is_left else "TURN_RIGHT")

    def _plan(self, observation, ahead_m, left_m):
        """Return the server's trajectory (N, 2) in metres, and the fields that every answer has."""
        files = {
            "image": ("image.jpg", _jpeg(observation.rgb)),
            "depth": ("depth.png", tenths_png(observation.depth_m)),
        }
        if self.mode == "image":
            files["goal"] = ("goal.jpg", _jpeg(self.goals[0]))
        fields = {}
        if self.mode == "point":
            fields["goal_data"] = json.dumps({"goal_x": [ahead_m], "goal_y": [left_m]})
        answer = self._post(
            f"{self.mode}{'' if self.mode == 'nogoal' else 'goal'}_step", *form(files, fields), self.timeout_s
        )
        path = np.asarray(answer["trajectory"], float)[0, :, :2]
        if path.ndim != 2 or len(path) < 2 or not np.isfinite(path).all():
            raise ValueError(f"the server at {self.url} returned no trajectory")
        scalars = {"value": float(np.max(answer["all_values"]))}
        if len(self.goals) > 1:
            scalars["photographs_left"] = float(len(self.goals))
        return path, {"diagnostics": {"scalars": scalars}, "raw_action": f"{np.hypot(*path[-1]):.2f} m"}

    def _post(self, route, body, content_type, timeout_s):
        return post(f"{self.url}/{route}", body, content_type, timeout_s)


def post(url, body, content_type, timeout_s):
    """Return the JSON with which a server answers."""
    request = urllib.request.Request(url, body, {"Content-Type": content_type})  # noqa: S310 - checked by the callers
    try:
        with urllib.request.urlopen(request, timeout=timeout_s) as response:  # noqa: S310
            return json.load(response)
    except (urllib.error.URLError, ValueError, OSError) as error:
        raise RuntimeError(f"the server at {url}: {error}") from error


def _in_robot_frame(point, pose):
    """Return how far a point of the episode's frame is ahead and to the left, in metres."""
    x_m, y_m = point[0] - pose.x_m, point[1] - pose.y_m
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    return x_m * cos + y_m * sin, y_m * cos - x_m * sin


def until(path, length_m):
    """Return the first part of a path, at least two points, without the robot's own position in front."""
    path = path[int(np.argmax(np.hypot(*path.T) > 1e-3)) :]
    path = np.vstack([path / 2, path]) if len(path) == 1 else path
    steps = np.hypot(*np.diff(np.vstack([[0.0, 0.0], path]), axis=0).T)
    return path[: max(2, int(np.searchsorted(np.cumsum(steps), length_m)) + 1)]


def _jpeg(rgb):
    """Encode an image with red and blue exchanged, as NavDP's own client does; its server exchanges them again."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(rgb[:, :, ::-1])).save(buffer, "JPEG", quality=95)
    return buffer.getvalue()


def tenths_png(depth_m):
    """Encode depth as the servers read it."""
    tenths = np.clip(np.nan_to_num(depth_m, nan=0.0) * DEPTH_UNITS_PER_METRE, 0, 65535).astype(np.uint16)
    buffer = io.BytesIO()
    Image.fromarray(tenths).save(buffer, "PNG")
    return buffer.getvalue()


def form(files, fields):
    """Return the body and the content type of a form with files and text."""
    boundary = uuid.uuid4().hex
    parts = [
        f'--{boundary}\r\nContent-Disposition: form-data; name="{name}"\r\n\r\n{text}\r\n'.encode()
        for name, text in fields.items()
    ]
    parts += [
        f'--{boundary}\r\nContent-Disposition: form-data; name="{name}"; filename="{file}"\r\n\r\n'.encode()
        + content
        + b"\r\n"
        for name, (file, content) in files.items()
    ]
    return b"".join(parts) + f"--{boundary}--\r\n".encode(), f"multipart/form-data; boundary={boundary}"
