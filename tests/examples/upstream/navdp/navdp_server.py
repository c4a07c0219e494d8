"""Stand-in for NavDP's server: the same routes, forms and answers, planned by a rule.

Written from InternRobotics/NavDP (commit cb33ff8), baselines/navdp/navdp_server.py, policy_agent.py and
policy_network.py: it refuses what they could not read. Its critic refuses where depth is short; then it turns as
policy_agent.py:203-205 does. After four trajectories it plans one of 10 cm. For an image goal, x and y of a trajectory
that ends under 0.5 m become 0, as in policy_network.py:149-150, which is upstream's sign for "arrived".
"""

import argparse
import email
import io
import json
from http.server import BaseHTTPRequestHandler, HTTPServer

import numpy as np
from PIL import Image

POINTS, CANDIDATES = 24, 16
STOP_UNDER_M = 0.5
agent = {"steps": -1, "threshold": 0.0}


def arrays(body, content_type):
    """Return the images of a form, as upstream's server decodes them."""
    head = f"Content-Type: {content_type}\r\n\r\n".encode()
    parts = {
        part.get_param("name", header="content-disposition"): part.get_payload(decode=True)
        for part in email.message_from_bytes(head + body).get_payload()
    }
    rgb = {
        name: np.asarray(Image.open(io.BytesIO(parts[name])).convert("RGB"))[:, :, ::-1]
        for name in ("image", "goal")
        if name in parts
    }
    depth = np.asarray(Image.open(io.BytesIO(parts["depth"])).convert("I")).astype(np.float32) / 10000.0
    return rgb, depth


class Handler(BaseHTTPRequestHandler):
    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        answer = getattr(self, self.path.strip("/"))(body)
        content = json.dumps(answer).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def navigator_reset(self, body):
        given = json.loads(body)
        assert np.array(given["intrinsic"]).shape == (3, 3)
        assert given["batch_size"] == 1
        agent.update(steps=0, threshold=given["stop_threshold"])
        return {"algo": "navdp"}

    def imagegoal_step(self, body):
        rgb, depth = arrays(body, self.headers["Content-Type"])
        assert rgb["goal"].ndim == 3
        return self.plan(rgb["image"], depth, image_goal=True)

    def nogoal_step(self, body):
        rgb, depth = arrays(body, self.headers["Content-Type"])
        return self.plan(rgb["image"], depth, image_goal=False)

    def plan(self, rgb, depth, image_goal):
        assert agent["steps"] >= 0, "no reset"
        assert rgb.shape[:2] == depth.shape
        agent["steps"] += 1
        path = np.zeros((1, POINTS, 3))
        path[0, :, 0] = np.linspace(0.06, 1.5, POINTS) if agent["steps"] <= 4 else np.linspace(0.005, 0.1, POINTS)
        path[0, :, 1] = -path[0, :, 0] / 100  # a little to the right
        if image_goal and np.hypot(*path[0, -1, :2]) < STOP_UNDER_M:
            path[..., :2] = 0.0
        middle = depth[depth.shape[0] // 3 : depth.shape[0] // 2, depth.shape[1] // 3 : -depth.shape[1] // 3]
        value = -4.0 if 0 < middle[middle > 0].min(initial=9.0) < 0.9 else -0.8
        if value < agent["threshold"]:
            path[..., 0], path[..., 1] = 0.0, np.sign(path[..., 1].mean())
        return {
            "trajectory": path.tolist(),
            "all_trajectory": np.repeat(path[:, None], CANDIDATES, 1).tolist(),
            "all_values": np.full((1, CANDIDATES), value).tolist(),
        }

    def log_message(self, *_):
        pass


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=8888)
    HTTPServer(("127.0.0.1", parser.parse_args().port), Handler).serve_forever()
