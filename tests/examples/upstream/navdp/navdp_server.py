"""Stand-in for the servers of NavDP and its benchmark's models: the same routes, forms and answers, planned by a rule.

Written from InternRobotics/NavDP (commit cb33ff8), baselines/*/*_server.py and the agents beside them: it refuses what
they could not read. NavDP's critic refuses where depth is short; then it turns as navdp/policy_agent.py:203-205 does.
After four trajectories since the images were forgotten a goal is reached: NavDP plans 10 cm, and x and y of a
trajectory that ends under 0.5 m become 0 (navdp/policy_network.py:149-150); GNM, ViNT and NoMaD multiply theirs by 0
(gnm/gnm_agent.py:78-79), and forget images only in `navigator_reset_env` (gnm/gnm_server.py:31-37). A point within
10 cm of the robot ends DD-PPO's way; iPlanner and ViPlanner plan on.
"""

import argparse
import email
import io
import json
from http.server import BaseHTTPRequestHandler, HTTPServer

import numpy as np
from PIL import Image

STOP_UNDER_M, ARRIVED_AFTER, CANDIDATES = 0.5, 4, 16
ROUTES = {
    "navdp": ("imagegoal", "pointgoal", "nogoal"),
    "gnm": ("imagegoal", "nogoal"),
    "vint": ("imagegoal", "nogoal"),
    "nomad": ("imagegoal", "nogoal"),
    "iplanner": ("pointgoal",),
    "viplanner": ("pointgoal",),
    "ddppo": ("pointgoal",),
}
POINTS = {"navdp": 24, "nomad": 81, "ddppo": 20}
agent = {"algo": "navdp", "steps": -1, "threshold": 0.0, "goal": None}


def form(body, content_type):
    """Return the parts of a form by name."""
    head = f"Content-Type: {content_type}\r\n\r\n".encode()
    return {
        part.get_param("name", header="content-disposition"): part.get_payload(decode=True)
        for part in email.message_from_bytes(head + body).get_payload()
    }


def rgb_of(content):
    """Return an image as upstream's servers decode it."""
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))[:, :, ::-1]


class Handler(BaseHTTPRequestHandler):
    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        route = self.path.strip("/")
        if route.endswith("_step") and route[: -len("_step")] not in ROUTES[agent["algo"]]:
            self.send_error(404)
            return
        content = json.dumps(getattr(self, route)(body)).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def navigator_reset(self, body):
        given = json.loads(body)
        assert np.array(given["intrinsic"]).shape == (3, 3)
        assert given["batch_size"] == 1
        if agent["steps"] < 0 or agent["algo"] not in ("gnm", "vint", "nomad"):
            agent.update(steps=0, threshold=given["stop_threshold"])
        return {"algo": agent["algo"]}

    def navigator_reset_env(self, body):
        assert json.loads(body)["env_id"] == 0
        agent["steps"] = 0
        return {"algo": agent["algo"]}

    def imagegoal_step(self, body):
        parts = form(body, self.headers["Content-Type"])
        goal = rgb_of(parts["goal"])
        if agent["goal"] is not None and (goal.shape != agent["goal"].shape or (goal != agent["goal"]).any()):
            agent["steps"] = 0  # the next photograph of a route is as far away
        agent["goal"] = goal
        return self.plan(parts)

    def pointgoal_step(self, body):
        parts = form(body, self.headers["Content-Type"])
        given = json.loads(parts["goal_data"])
        return self.plan(parts, point=np.array([given["goal_x"][0], given["goal_y"][0]], float))

    def nogoal_step(self, body):
        return self.plan(form(body, self.headers["Content-Type"]), has_goal=False)

    def plan(self, parts, point=None, has_goal=True):
        assert agent["steps"] >= 0, "no reset"
        depth = np.asarray(Image.open(io.BytesIO(parts["depth"])).convert("I")).astype(np.float32) / 10000.0
        assert rgb_of(parts["image"]).shape[:2] == depth.shape
        algo, count = agent["algo"], POINTS.get(agent["algo"], 51)
        agent["steps"] += 1
        path = np.zeros((1, count, 2 if algo == "nomad" else 3))
        far = 1.5 if point is not None or agent["steps"] <= ARRIVED_AFTER else 0.1
        towards = np.array([1.0, -0.01]) if point is None else point / max(float(np.hypot(*point)), 1e-9)
        path[0, :, :2] = np.linspace(0.04 if algo == "navdp" else 0.0, 1.0, count)[:, None] * far * towards
        if algo == "ddppo":
            path[..., :2] = np.linspace(0.0, 1.0, count)[:, None] * discrete(point)
        value = 0.0
        if algo == "navdp":
            if has_goal and np.hypot(*path[0, -1, :2]) < STOP_UNDER_M:
                path[..., :2] = 0.0
            middle = depth[depth.shape[0] // 3 : depth.shape[0] // 2, depth.shape[1] // 3 : -depth.shape[1] // 3]
            value = -4.0 if 0 < middle[middle > 0].min(initial=9.0) < 0.9 else -0.8
            if value < agent["threshold"]:
                path[..., 0], path[..., 1] = 0.0, np.sign(path[..., 1].mean())
        elif algo in ("gnm", "vint", "nomad") and has_goal and far < 1.0:
            path *= 0.0
        return {
            "trajectory": path.tolist(),
            "all_trajectory": np.repeat(path[:, None], CANDIDATES, 1).tolist(),
            "all_values": np.full((1, CANDIDATES), value).tolist(),
        }

    def log_message(self, *_):
        pass


def discrete(point):
    """Return the end of DD-PPO's stop, turn or forward: (0, 0), (0, 1), (0, -1) or (1, 0)."""
    if np.hypot(*point) < 0.1:
        return np.zeros(2)
    bearing = np.arctan2(point[1], point[0])
    return np.array([1.0, 0.0]) if abs(bearing) < 0.3 else np.array([0.0, np.sign(bearing)])


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=8888)
    parser.add_argument("--algo", choices=sorted(ROUTES), default="navdp")
    arguments = parser.parse_args()
    agent["algo"] = arguments.algo
    HTTPServer(("127.0.0.1", arguments.port), Handler).serve_forever()
