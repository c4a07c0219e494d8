"""Measures time per step and memory growth of a model over WebSocket.

usage: python benchmarks/wire_cost.py [STEPS]   (2000 when absent)

The model does nothing, so the time (milliseconds) is that of the transfer: packing, loopback, unpacking, and back. The
script compares it with the copy of the observation that a policy in this process receives, times both at each step of
one run, and prints the growth of memory in MiB over the last 90 % of the steps.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil

from vsnbench.errors import ModelLostError
from vsnbench.models.remote import vsnbench_policy
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation, Sensor, shown_to_policy
from vsnbench.values.pose import Pose

PORT = 8796
SENSORS = frozenset({Sensor.RGB, Sensor.DEPTH, Sensor.ODOMETRY})
IDLE = """
class Model:
    card = {"name": "idle", "sensors": ["rgb", "depth", "odometry"]}

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        return "TURN_LEFT"
"""
ENCODINGS = {
    "raw, float32 depth": "rgb: raw",
    "raw, 16-bit depth": "depth: mm16",
    "JPEG, 16-bit depth": "rgb: jpeg\ndepth: mm16",
}


def observations(count: int) -> list[Observation]:
    """Return observations of 640 x 480 pixels that compress like a room: smooth, with some noise."""
    rng = np.random.default_rng(1)
    camera = Camera(width=640, height=480, horizontal_fov_deg=60, mount_height_m=0.6)
    ramp = np.linspace(0, 200, 640, dtype=np.float32)[None, :, None] + np.zeros((480, 1, 3), np.float32)
    found = []
    for number in range(count):
        rgb = (ramp + rng.normal(0, 3, ramp.shape)).clip(0, 255).astype(np.uint8)
        depth_m = (1 + ramp[..., 0] / 50 + rng.normal(0, 0.01, ramp.shape[:2])).astype(np.float32)
        found.append(Observation(rgb, depth_m, Pose(0.25 * number, 0.0, 0.0), float(number), camera))
    return found


def main() -> None:
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    seen = observations(8)
    with tempfile.TemporaryDirectory() as directory:
        place = Path(directory)
        (place / "idle.py").write_text(IDLE)
        command = [sys.executable, vsnbench_policy.__file__, "idle:Model", "--port", str(PORT)]
        server = subprocess.Popen(command, cwd=place, stderr=subprocess.DEVNULL)
        try:
            for name, settings in ENCODINGS.items():
                (place / "wire.yaml").write_text(settings)
                policy = _connected(place / "wire.yaml")
                policy.reset("chair", 0)
                _measure(name, policy, seen, steps, server.pid)
                policy.close()
        finally:
            server.terminate()
            server.wait()


def _connected(settings: Path) -> RemotePolicy:
    give_up = time.monotonic() + 20
    while True:
        try:
            return RemotePolicy(f"ws://127.0.0.1:{PORT}", settings)
        except ModelLostError:
            if time.monotonic() > give_up:
                raise
            time.sleep(0.1)


def _measure(name: str, policy: RemotePolicy, seen: list[Observation], steps: int, server: int) -> None:
    here, there, bytes_sent = [], [], 0
    memory = {}
    for number in range(steps):
        observation = seen[number % len(seen)]
        began = time.perf_counter()
        shown = shown_to_policy(observation, SENSORS)
        between = time.perf_counter()
        decision = policy.act(shown)
        there.append(time.perf_counter() - between)
        here.append(between - began)
        bytes_sent = decision.diagnostics.details["wire"]["sent_bytes"]
        if number in (steps // 10, steps - 1):
            memory[number] = [psutil.Process(pid).memory_info().rss / 2**20 for pid in (os.getpid(), server)]
    (early_us, early_them), (late_us, late_them) = memory.values()
    p95 = sorted(there)[int(0.95 * len(there))]
    print(
        f"{name}: {bytes_sent / 1e6:.2f} MB per step; median {statistics.median(there) * 1e3:.2f} ms added "
        f"(p95 {p95 * 1e3:.2f}), against {statistics.median(here) * 1e3:.2f} ms for the copy in process: "
        f"ratio {statistics.median(there) / statistics.median(here):.1f}; memory over the last 90 % of {steps} steps: "
        f"client {late_us - early_us:+.1f} MiB, server {late_them - early_them:+.1f} MiB"
    )


if __name__ == "__main__":
    main()
