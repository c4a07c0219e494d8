"""NavDP (InternRobotics) as a model: its own HTTP server plans, the robot drives along the trajectory.

Start NavDP's server, then this file next to vsnbench_policy.py. It needs numpy and pillow:

    python navdp_server.py --port 8888 --checkpoint navdp.ckpt          # in NavDP/baselines/navdp
    python vsnbench_policy.py navdp_adapter:NavDP --port 8765
    vsnbench run --model ws://127.0.0.1:8765 --site examples/goals.yaml --goal photo-bed

Image goals use `imagegoal_step`. With {"mode": "nogoal"} the model explores and never stops, whatever the goal is.
Lines of upstream are those of InternRobotics/NavDP at commit cb33ff8.
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
TURN_RAD = math.radians(30)
"""A turn as a waypoint, the size of a discrete one."""


class NavDP:
    """Asks a NavDP server for a trajectory at every step. The server has one robot: serve one session."""

    urls: ClassVar = set()
    """Servers that this process uses."""

    def __init__(
        self,
        url="http://127.0.0.1:8888",
        mode="image",
        horizon_m=1.0,
        stop_threshold=-3.0,
        weights_label="",
        timeout_s=8.0,
        turns="discrete",
    ):
        """Set the model up.

        Args:
            url: address of NavDP's server.
            mode: `image` for image goals, `nogoal` to explore.
            horizon_m: length that the robot drives before it asks again.
            stop_threshold: the server turns on the spot if its critic values all trajectories below this; -3 as in
                upstream's evaluations (eval_imagegoal_wheeled.py:12).
            weights_label: description of the server's checkpoint, which it does not tell.
            timeout_s: time limit of a request.
            turns: `discrete`, or `waypoint` for `vsnbench run --continuous`, where a turn must replace a path.
        """
        if turns not in ("discrete", "waypoint"):
            raise ValueError("turns must be discrete or waypoint")
        if mode not in ("image", "nogoal"):
            raise ValueError("mode must be image or nogoal")
        if not url.startswith(("http://", "https://")):
            raise ValueError("url must begin with http:// or https://")
        if url in self.urls:
            raise ValueError(f"NavDP's server at {url} keeps the images of one robot: serve one session")
        self.urls.add(url)
        self.url, self.mode, self.timeout_s = url.rstrip("/"), mode, timeout_s
        self.horizon_m, self.stop_threshold = horizon_m, stop_threshold
        self.card = {
            "name": "navdp",
            "sensors": ["rgb", "depth"],
            "goal_kinds": ["image"] if mode == "image" else ["category", "text"],
            "action_kinds": ["discrete", "trajectory", *([turns] if turns != "discrete" else [])],
            "weights_label": weights_label,
            "settings": {"mode": mode, "horizon_m": horizon_m, "stop_threshold": stop_threshold},
            # The camera of upstream's evaluations (configs/robots/dingo_config.py:48-58): 2 atan(1.88 / (2 * 1.4)).
            "camera": {"horizontal_fov_deg": 67.8, "width": 640, "height": 360},
            "deterministic": False,  # diffusion from the server's own random numbers
        }
        self.goal, self.turns = None, turns

    def begin(self, task):
        """Start an episode: the server forgets the images of the last one."""
        self.goal = task.goal.image
        camera = task.robot.camera
        focal = camera.width / 2 / math.tan(math.radians(camera.horizontal_fov_deg) / 2)
        intrinsic = [[focal, 0.0, camera.width / 2], [0.0, focal, camera.height / 2], [0.0, 0.0, 1.0]]
        request = {"intrinsic": intrinsic, "stop_threshold": self.stop_threshold, "batch_size": 1}
        answer = self._post("navigator_reset", json.dumps(request).encode(), "application/json")
        if answer.get("algo") != "navdp":  # servers of upstream's other models have the same routes
            raise ValueError(f"the server at {self.url} is that of {answer.get('algo')!r:.40}, not of NavDP")

    def reset(self, goal, seed):
        """Refuse an episode without a task, which has no camera."""
        raise ValueError("navdp needs the robot's camera: use a newer vsnbench on the robot's side")

    def act(self, observation):
        """Return the beginning of the trajectory that the server plans."""
        files = {"image": ("image.jpg", _jpeg(observation.rgb)), "depth": ("depth.png", _png(observation.depth_m))}
        if self.mode == "image":
            files["goal"] = ("goal.jpg", _jpeg(self.goal))
        answer = self._post("imagegoal_step" if self.mode == "image" else "nogoal_step", *_form(files))
        path = np.asarray(answer["trajectory"], float)[0, :, :2]
        if path.ndim != 2 or len(path) < 2 or not np.isfinite(path).all():
            raise ValueError("NavDP's server returned no trajectory")
        value = float(np.max(answer["all_values"]))
        found = {"diagnostics": {"scalars": {"value": value}}, "raw_action": f"{np.hypot(*path[-1]):.2f} m"}
        if not path[:, 0].any():  # no way forward
            # In image mode upstream zeroes a trajectory that ends under 0.5 m (policy_network.py:149-150). Where its
            # critic refuses all trajectories, x is 0 and y the side to turn to (policy_agent.py:203-205).
            if self.mode == "image" and not path[:, 1].any():
                return dict(found, action="STOP")
            is_left = path[-1, 1] > 0
            if self.turns == "waypoint":
                turn_rad = TURN_RAD if is_left else -TURN_RAD
                return dict(found, movement={"kind": "waypoint", "x_m": 0.0, "y_m": 0.0, "heading_rad": turn_rad})
            return dict(found, action="TURN_LEFT" if is_left else "TURN_RIGHT")
        return dict(found, movement={"kind": "trajectory", "points": _until(path, self.horizon_m).tolist()})

    def _post(self, route, body, content_type):
        headers = {"Content-Type": content_type}
        request = urllib.request.Request(f"{self.url}/{route}", body, headers)  # noqa: S310 - checked in __init__
        try:
            with urllib.request.urlopen(request, timeout=self.timeout_s) as response:  # noqa: S310
                return json.load(response)
        except (urllib.error.URLError, ValueError, OSError) as error:
            raise RuntimeError(f"NavDP's server at {self.url}/{route}: {error}") from error


def _until(path, length_m):
    """Return the first part of a path, at least two points."""
    steps = np.hypot(*np.diff(np.vstack([[0.0, 0.0], path]), axis=0).T)
    return path[: max(2, int(np.searchsorted(np.cumsum(steps), length_m)) + 1)]


def _jpeg(rgb):
    """Encode an image with red and blue exchanged, as NavDP's own client does; its server exchanges them again."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(rgb[:, :, ::-1])).save(buffer, "JPEG", quality=95)
    return buffer.getvalue()


def _png(depth_m):
    tenths = np.clip(np.nan_to_num(depth_m, nan=0.0) * DEPTH_UNITS_PER_METRE, 0, 65535).astype(np.uint16)
    buffer = io.BytesIO()
    Image.fromarray(tenths).save(buffer, "PNG")
    return buffer.getvalue()


def _form(files):
    """Return the body and the content type of a form with files."""
    boundary = uuid.uuid4().hex
    parts = [
        f'--{boundary}\r\nContent-Disposition: form-data; name="{name}"; filename="{file}"\r\n\r\n'.encode()
        + content
        + b"\r\n"
        for name, (file, content) in files.items()
    ]
    return b"".join(parts) + f"--{boundary}--\r\n".encode(), f"multipart/form-data; boundary={boundary}"
