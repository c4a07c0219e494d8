"""Stand-in for the HTTP servers of StreamVLN and DualVLN: the same routes, forms and answers, by a rule.

Written from InternRobotics/StreamVLN (commit e48f6ff), streamvln/http_realworld_server.py `eval_vln`, and
InternRobotics/InternNav (commit 7a5c624), scripts/realworld/http_internvla_server.py `eval_dual`, with the line changed
that reads the instruction. `eval_vln` answers with four actions, and with STOP alone once it has said STOP; `eval_dual`
with a list of actions, or with 33 points from the robot on. Both forget images where `reset` is true.
"""

import argparse
import email
import io
import json
from http.server import BaseHTTPRequestHandler, HTTPServer

import numpy as np
from PIL import Image

state = {"images": 0, "has_stopped": False}


class Handler(BaseHTTPRequestHandler):
    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        head = f"Content-Type: {self.headers['Content-Type']}\r\n\r\n".encode()
        parts = {
            part.get_param("name", header="content-disposition"): part.get_payload(decode=True)
            for part in email.message_from_bytes(head + body).get_payload()
        }
        data = json.loads(parts["json"])
        assert data["instruction"]
        if data["reset"]:
            state.update(images=0, has_stopped=False)
        state["images"] += 1
        image = np.asarray(Image.open(io.BytesIO(parts["image"])).convert("RGB"))
        content = json.dumps(getattr(self, self.path.strip("/"))(image, parts)).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def eval_vln(self, image, parts):
        if state["has_stopped"]:
            return {"action": [0]}
        actions = [[1, 2, 1, 3], [3, 1, 1, 0]][state["images"] - 1]
        state["has_stopped"] = 0 in actions
        return {"action": actions}

    def eval_dual(self, image, parts):
        depth = np.asarray(Image.open(io.BytesIO(parts["depth"])).convert("I"))
        assert depth.shape == image.shape[:2]
        if state["images"] in (2, 3):
            path = np.zeros((33, 2))
            path[:, 0] = np.linspace(0.0, 1.6, 33)
            return {"trajectory": path.tolist(), "pixel_goal": [30, 80]}
        return {"discrete_action": {1: [2, 2, 1], 4: [5], 5: [3, 3], 6: [0]}[state["images"]]}

    def log_message(self, *_):
        pass


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=5801)
    HTTPServer(("127.0.0.1", parser.parse_args().port), Handler).serve_forever()
