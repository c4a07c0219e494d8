"""Checks VLV's weights: contents of the value network's file, the detector, and the speed of both."""

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from vsnbench.models.checkpoints.torch_runtime import available_device
from vsnbench.models.checkpoints.weights import find_weights
from vsnbench.models.contract import ModelCheck, Timing
from vsnbench.models.vlv.detectors.choosing import open_detector
from vsnbench.models.vlv.goals import CLASS_OF_GOAL, VALUE_CLASSES
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.models.vlv.value.estimate import FILE_NAME, LearnedValue
from vsnbench.models.vlv.value.network import ACTIONS, IMAGE_SIZE_PX
from vsnbench.models.vlv.value.weights import read_value_weights
from vsnbench.values.camera import Camera
from vsnbench.values.observation import InstanceImage, Observation
from vsnbench.values.pose import Pose

_TIMED_VIEWS = 8
_TIMED_DETECTIONS = 2


def check_weights(weights: Path | None, settings: VLVSettings, device: str) -> ModelCheck:
    """Check the value network's file and the detector that the settings choose.

    Raises:
        UsageError: the device is unknown.
        ModelError: weights are missing or cannot be used.
    """
    path = find_weights("vlv", FILE_NAME, weights)
    read = read_value_weights(path)
    value = LearnedValue(read, available_device(device))
    detector = open_detector(settings, device)
    view = _synthetic_view()
    engine = f"PyTorch on {available_device(device)}"
    return ModelCheck(
        model="vlv",
        weights=path,
        sha256=read.sha256,
        size_bytes=path.stat().st_size,
        facts={
            "architecture": "ResNet-18 Q network",
            "image": f"{IMAGE_SIZE_PX} x {IMAGE_SIZE_PX} px",
            "classes": ", ".join(VALUE_CLASSES),
            "actions": ACTIONS,
            "tensors": len(read.tensors),
            "parameters": sum(
                tensor.numel()
                for name, tensor in read.tensors.items()
                if not name.endswith(("running_mean", "running_var", "num_batches_tracked"))
            ),
            "detector": detector.name,
            "detector_sha256": detector.weights_sha256 or None,
            "detector_finds": ", ".join(goal for goal, name in CLASS_OF_GOAL.items() if name in detector.classes),
        },
        chosen_engine=engine,
        parity=None,
        timings=(
            _timing(f"value network, {engine}", lambda: value.of(view.rgb, VALUE_CLASSES[0]), _TIMED_VIEWS),
            _timing(detector.name, lambda: detector.detect(view), _TIMED_DETECTIONS),
        ),
    )


def _timing(label: str, work: Callable[[], object], count: int) -> Timing:
    work()
    durations_ms = []
    for _ in range(count):
        start_s = time.perf_counter()
        work()
        durations_ms.append((time.perf_counter() - start_s) * 1e3)
    return Timing(label, statistics.median(durations_ms), count)


def _synthetic_view() -> Observation:
    """Return a synthetic observation for detectors."""
    rgb = np.random.default_rng(20250).integers(0, 256, (480, 640, 3), np.uint8)
    ids = np.zeros((480, 640), np.int32)
    ids[200:400, 200:400] = 1
    depth = np.full((480, 640), 2.0, np.float32)
    camera = Camera(width=640, height=480, horizontal_fov_deg=60, mount_height_m=0.6)
    return Observation(rgb, depth, Pose(0.0, 0.0), 0.0, camera, InstanceImage(ids, {1: "sofa"}))
