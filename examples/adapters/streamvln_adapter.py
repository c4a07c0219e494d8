"""StreamVLN and DualVLN (InternRobotics) as models: their own HTTP servers follow instructions.

Start one of the servers, then this file and navdp_adapter.py next to vsnbench_policy.py. They need numpy and pillow:

    python streamvln/http_realworld_server.py                           # in StreamVLN
    python vsnbench_policy.py streamvln_adapter:StreamVLN --port 8765
    vsnbench run --model ws://127.0.0.1:8765 --site examples/goals.yaml --goal past-the-sofa

DualVLN's is scripts/realworld/http_internvla_server.py in InternNav, with `streamvln_adapter:DualVLN`. Both servers
follow one instruction that is written in their file. Let them read the one that is sent here:

    sed -i 's/instruction = "[^"]*"/instruction = data["instruction"]/' FILE

README.md lists what else DualVLN's needs. Lines of upstream are those of InternRobotics/StreamVLN at commit e48f6ff and
InternRobotics/InternNav at commit 7a5c624.
"""

import io
import json
import math
from typing import ClassVar

import numpy as np
from navdp_adapter import form, post, tenths_png, until
from PIL import Image

STEPS = {
    0: "STOP",
    1: {"kind": "move", "distance_m": 0.25},
    2: {"kind": "move", "turn_rad": math.radians(15)},
    3: {"kind": "move", "turn_rad": -math.radians(15)},
}
"""What numbers mean for upstream's clients (go2_vln_client.py:171-194, http_internvla_client.py:314-336)."""


class _Server:
    """What both have in common: one robot, an image as JPEG, the instruction, and steps as numbers."""

    urls: ClassVar = set()
    """Servers that this process uses."""
    route, name, sensors, action_kinds = "", "", ("rgb",), ("discrete", "move", "chunk")

    def __init__(self, url, category_as, weights_label, timeout_s, **settings):
        """Store the settings."""
        if not url.startswith(("http://", "https://")):
            raise ValueError("url must begin with http:// or https://")
        if url in self.urls:
            raise ValueError(f"the server at {url} keeps the images of one robot: serve one session")
        self.urls.add(url)
        self.url, self.category_as, self.timeout_s = f"{url.rstrip('/')}/{self.route}", category_as, timeout_s
        self.card = {
            "name": self.name,
            "sensors": list(self.sensors),
            "goal_kinds": ["instruction", "text", "category"],
            "action_kinds": list(self.action_kinds),
            # The camera and the steps of upstream's evaluations (StreamVLN: config/vln_r2r.yaml:23-35; InternNav:
            # scripts/eval/configs/vln_r2r.yaml:22-34).
            "camera": {"horizontal_fov_deg": 79, "width": 640, "height": 480},
            "forward_m": 0.25,
            "turn_deg": 15.0,
            "weights_label": weights_label,
            "settings": dict(settings, category_as=category_as),
            "deterministic": False,  # half precision on a GPU
        }
        self.instruction, self.is_first = "", True

    def reset(self, goal, seed):
        """Start an episode. The server forgets the last one with the first image of this."""
        is_category = getattr(goal, "kind", "category") == "category"
        text = getattr(goal, "text", "") or str(goal)
        self.instruction = self.category_as.format(text) if is_category else text
        self.is_first = True

    def ask(self, rgb, **files):
        """Return the server's answer to an image."""
        buffer = io.BytesIO()
        Image.fromarray(np.ascontiguousarray(rgb)).save(buffer, "JPEG", quality=95)
        fields = {"json": json.dumps({"reset": self.is_first, "instruction": self.instruction})}
        body, content_type = form(dict(files, image=("image.jpg", buffer.getvalue())), fields)
        answer = post(self.url, body, content_type, self.timeout_s)
        self.is_first = False
        return answer

    def steps(self, numbers):
        """Return a decision that executes the server's numbers in order, up to STOP."""
        unknown = sorted({str(number) for number in numbers} - {str(number) for number in (*STEPS, 5, 9)})
        if unknown:
            raise ValueError(f"{self.name} answered with {', '.join(unknown):.60}, which is no step")
        raw = {"raw_action": " ".join(str(number) for number in numbers)}
        parts = [STEPS[number] for number in numbers if number in STEPS]
        if not parts:  # look down (5, 9), which upstream's client skips (http_internvla_client.py:187)
            return dict(raw, action="NOOP")
        if "STOP" in parts:
            parts = parts[: parts.index("STOP") + 1]
        return dict(raw, action="STOP") if parts == ["STOP"] else dict(raw, parts=parts)


class StreamVLN(_Server):
    """Executes the server's four actions, then shows it the next image, as upstream's client does."""

    route, name = "eval_vln", "streamvln"

    def __init__(self, url="http://127.0.0.1:5801", category_as="Search for a {}.", weights_label="", timeout_s=8.0):
        """Set the model up.

        Args:
            url: address of the server.
            category_as: instruction for a goal that is a category.
            weights_label: description of the server's checkpoint, which it does not tell.
            timeout_s: time limit of a request.
        """
        super().__init__(url, category_as, weights_label, timeout_s)

    def act(self, observation):
        """Return the next actions."""
        # Upstream's client sends blue first (go2_vln_client.py:127), and the server exchanges it
        # (http_realworld_server.py:71).
        return self.steps(self.ask(observation.rgb[:, :, ::-1])["action"])


class DualVLN(_Server):
    """Executes the server's discrete actions, or the beginning of its trajectory."""

    route, name, sensors = "eval_dual", "dualvln", ("rgb", "depth")
    action_kinds = ("discrete", "move", "chunk", "trajectory")

    def __init__(
        self,
        url="http://127.0.0.1:5801",
        category_as="Search for a {}.",
        weights_label="",
        timeout_s=8.0,
        horizon_m=0.25,
    ):
        """Set the model up.

        Args:
            url: address of the server.
            category_as: instruction for a goal that is a category.
            weights_label: description of the server's checkpoint, which it does not tell.
            timeout_s: time limit of a request.
            horizon_m: length of a trajectory that the robot drives before it asks again; by default a step of the
                evaluations, because each request adds an image to the model's memory. Upstream's client drives on and
                asks every 0.3 s.
        """
        super().__init__(url, category_as, weights_label, timeout_s, horizon_m=horizon_m)
        self.horizon_m = horizon_m

    def act(self, observation):
        """Return the next actions or the way."""
        answer = self.ask(observation.rgb, depth=("depth.png", tenths_png(observation.depth_m)))
        if "discrete_action" in answer:
            return self.steps(answer["discrete_action"])
        path = np.asarray(answer["trajectory"], float)[:, :2]  # metres, x forward, y left, the robot first
        if path.ndim != 2 or len(path) < 2 or not np.isfinite(path).all():
            raise ValueError(f"the server at {self.url} returned no trajectory")
        found = {"raw_action": f"{np.hypot(*path[-1]):.2f} m"}
        if "pixel_goal" in answer:
            found["diagnostics"] = {"details": {"pixel_goal": answer["pixel_goal"]}}
        if np.hypot(*path.T).max() < 1e-3:  # nowhere to go
            return dict(found, action="NOOP")
        return dict(found, movement={"kind": "trajectory", "points": until(path, self.horizon_m).tolist()})
