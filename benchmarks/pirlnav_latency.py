"""Measures PIRLNav's latency on CPU against eager PyTorch, and memory growth.

    python benchmarks/pirlnav_latency.py                 full size, synthetic weights of the released layout
    python benchmarks/pirlnav_latency.py --weights FILE  another checkpoint
    python benchmarks/pirlnav_latency.py --batch         8 observations one by one and together, on one thread only

Prints one JSON object: milliseconds per step of both engines, milliseconds of a step outside the engine, and memory
growth in MiB over 10,000 steps. Both engines run in this process and alternate step by step, so that other load on the
machine affects both equally.
"""

import argparse
import json
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import torch

from vsnbench.models.pirlnav.acceleration import choose_engine
from vsnbench.models.pirlnav.architecture import Architecture
from vsnbench.models.pirlnav.checkpoint import read_checkpoint
from vsnbench.models.pirlnav.engine import Engine, StepInput, StepOutput, synthetic_steps
from vsnbench.models.pirlnav.policy import PIRLNav
from vsnbench.models.pirlnav.preprocessing import preprocess
from vsnbench.models.pirlnav.settings import PIRLNavSettings, Runtime
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

MEMORY_STEPS = 10_000
CAMERA = Camera(width=640, height=480, horizontal_fov_deg=79, mount_height_m=0.88)


class Instant(Engine):
    """An engine that returns immediately, to time the policy around it."""

    label = "nothing"

    def step(self, step: StepInput) -> StepOutput:
        """Return zeros."""
        return StepOutput(np.zeros(6, np.float32), float(step.begins))


def median_ms(action: Callable[[], object], times: int) -> float:
    durations = []
    for _ in range(times):
        begun = time.perf_counter()
        action()
        durations.append(time.perf_counter() - begun)
    return statistics.median(durations) * 1e3


def engines_ms(weights: Path, times: int) -> dict[str, float | str]:
    checkpoint = read_checkpoint(weights)
    eager = choose_engine(checkpoint, PIRLNavSettings(runtime="torch"), "cpu").engine
    default = choose_engine(checkpoint, PIRLNavSettings(), "cpu")
    steps = synthetic_steps(checkpoint.architecture)
    for step in steps:
        eager.step(step)
        default.engine.step(step)
    eager_ms, default_ms = [], []
    for index in range(times):
        step = steps[index % len(steps)]
        eager_ms.append(median_ms(lambda step=step: eager.step(step), 1))  # type: ignore[misc]
        default_ms.append(median_ms(lambda step=step: default.engine.step(step), 1))  # type: ignore[misc]
    reference, chosen = statistics.median(eager_ms), statistics.median(default_ms)
    return {
        "eager": eager.label,
        "default": default.engine.label,
        "eager_ms": round(reference, 2),
        "default_ms": round(chosen, 2),
        "eager_best_ms": round(min(eager_ms), 2),
        "default_best_ms": round(min(default_ms), 2),
        "times_as_fast": round(reference / chosen, 2),
        "largest_logit_difference": default.agreement.largest_difference if default.agreement else 0.0,
    }


def together_ms(weights: Path, times: int) -> dict[str, float | str]:
    """Return processor milliseconds per observation in batches of 1, 4 and 8: eager PyTorch, one thread."""
    torch.set_num_threads(1)
    engine = choose_engine(read_checkpoint(weights), PIRLNavSettings(runtime="torch"), "cpu").engine
    steps = synthetic_steps(read_checkpoint(weights).architecture)[:1] * 8
    spent: dict[int, list[float]] = {1: [], 4: [], 8: []}
    for _ in range(times):
        for count, durations in spent.items():
            begun = time.process_time()
            for first in range(0, 8, count):
                engine.step_together(steps[first : first + count], [None] * count)
            durations.append((time.process_time() - begun) / 8 * 1e3)
    return {"engine": engine.label} | {f"of_{count}_ms": round(min(took), 2) for count, took in spent.items()}


def policy_share_ms(small: Path, times: int) -> dict[str, float]:
    """Time `act` on a camera image with an engine that returns immediately; preprocessing is its largest part."""
    policy = PIRLNav(small, PIRLNavSettings(runtime="torch"), "cpu")
    policy.chosen = replace(policy.chosen, engine=Instant())
    rgb = np.random.default_rng(0).integers(0, 256, (480, 640, 3), np.uint8)
    observation = Observation(rgb, None, Pose(0.5, 0.25, 1.0), 0.0, CAMERA)
    policy.reset("chair", seed=1)
    policy.act(observation)
    whole = median_ms(lambda: policy.act(observation), times)
    image = median_ms(lambda: preprocess(rgb, 256), times)
    return {"act_ms": round(whole, 3), "of_which_image_ms": round(image, 3)}


def memory_growth_mib(weights: Path, runtime: Runtime) -> float:
    """Run the small network for many steps; return the growth of resident memory after the first tenth."""
    policy = PIRLNav(weights, PIRLNavSettings(runtime=runtime), "cpu")
    rgb = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    observation = Observation(rgb, None, Pose(0.5, 0.25, 1.0), 0.0, CAMERA.resized(64, 64))
    policy.reset("chair", seed=1)
    after_warming_up = 0.0
    for step in range(MEMORY_STEPS):
        policy.act(observation)
        if step == MEMORY_STEPS // 10:
            after_warming_up = resident_mib()
    return round(resident_mib() - after_warming_up, 2)


def resident_mib() -> float:
    return float(psutil.Process().memory_info().rss / 2**20)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--weights", type=Path, help="a PIRLNav checkpoint; default: synthetic weights")
    parser.add_argument("--steps", type=int, default=60, help="timed steps of each engine")
    parser.add_argument("--batch", action="store_true", help="only compare single observations with batches")
    arguments = parser.parse_args()
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from tests.models.pirlnav.checkpoints import SMALL, write_checkpoint

    with tempfile.TemporaryDirectory() as directory:
        os.environ["XDG_CACHE_HOME"] = directory
        small = write_checkpoint(Path(directory) / "small.ckpt", SMALL)
        tiny = write_checkpoint(Path(directory) / "tiny.ckpt", SMALL.model_copy(update={"image_size_px": 64}))
        weights = arguments.weights or write_checkpoint(Path(directory) / "full.ckpt", Architecture())
        if arguments.batch:
            print(json.dumps(together_ms(weights, 10), indent=2))
            return
        report = {
            "load_average_1min": round(os.getloadavg()[0], 2),
            "cores": os.cpu_count(),
            "engines": engines_ms(weights, arguments.steps),
            "policy": policy_share_ms(small, 300),
        }
        torch.set_num_threads(1)
        report["memory_growth_mib_over_10000_steps"] = {
            runtime: memory_growth_mib(tiny, runtime) for runtime in ("torch", "onnxruntime")
        }
    print(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
