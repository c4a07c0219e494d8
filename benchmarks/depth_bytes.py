"""Measures size, time and reproducibility of depth image files, by encoder of their compressed part.

Renders depth images from random poses in the embedded apartment, and encodes them in several processes, whose memory
layouts differ. Prints the mean size, the median processor time, and the number of images of which two processes wrote
different bytes.

    python benchmarks/depth_bytes.py [--images 2000] [--processes 6]
"""

import argparse
import hashlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from isal import isal_zlib

from vsnbench.simulator.rendering.renderer import Renderer
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import load_site
from vsnbench.values.camera import Camera
from vsnbench.values.encoding.depth_kernels import filter_up
from vsnbench.values.encoding.images import depth_millimetres
from vsnbench.values.pose import Pose

Encoder = Callable[[Any], bytes]
ENCODERS: dict[str, Encoder] = {
    "isal, level 0": lambda rows: bytes(isal_zlib.compress(rows, 0)),
    "isal, level 1": lambda rows: bytes(isal_zlib.compress(rows, 1)),
    "isal, level 2": lambda rows: bytes(isal_zlib.compress(rows, 2)),
    "isal, level 3": lambda rows: bytes(isal_zlib.compress(rows, 3)),
    "zlib, level 1": lambda rows: zlib.compress(rows, 1),
}


def rendered(images: int, seed: int) -> list[npt.NDArray[np.uint16]]:
    """Return depth images in millimetres."""
    random, renderer = np.random.default_rng(seed), Renderer(build_scene(load_site("apartment")))
    camera = Camera(width=640, height=480, horizontal_fov_deg=79, mount_height_m=0.88)
    poses = [Pose(*random.uniform((0.5, 0.5, -np.pi), (9.0, 7.0, np.pi))) for _ in range(images)]
    return [depth_millimetres(renderer.render(camera, pose).depth_m) for pose in poses]


def encode(file: Path) -> dict[str, Any]:
    """Return digests, sizes and times of all images, by encoder."""
    waste = [bytearray(size) for size in np.random.default_rng().integers(1, 1 << 20, 64)]  # another heap per process
    del waste[::2]
    found: dict[str, Any] = {name: {"digests": [], "bytes": [], "ms": []} for name in ENCODERS}
    with np.load(file) as images:
        for name in images.files:
            image = images[name]
            rows = np.empty((image.shape[0], 1 + 2 * image.shape[1]), np.uint8)
            filter_up(image, rows)
            for encoder, compress in ENCODERS.items():
                began = time.process_time()
                content = compress(rows.data)
                found[encoder]["ms"].append(1e3 * (time.process_time() - began))
                found[encoder]["bytes"].append(len(content))
                found[encoder]["digests"].append(hashlib.sha256(content).hexdigest())
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--images", type=int, default=2000)
    parser.add_argument("--processes", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--encode", type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.encode:
        json.dump(encode(asked.encode), sys.stdout)
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "depth.npz")
        np.savez_compressed(file, *rendered(asked.images, asked.seed))
        command = [sys.executable, __file__, "--encode", str(file)]
        runs = []
        for process in range(asked.processes):
            environment = os.environ | {"PADDING": "x" * 997 * process}
            done = subprocess.run(command, stdout=subprocess.PIPE, check=True, env=environment)
            runs.append(json.loads(done.stdout))
    print(f"{asked.images} images, {asked.processes} processes")
    for name in ENCODERS:
        digests = zip(*(run[name]["digests"] for run in runs), strict=True)
        differing = sum(len(set(of_one)) > 1 for of_one in digests)
        size, spent = statistics.mean(runs[0][name]["bytes"]), statistics.median(runs[0][name]["ms"])
        print(f"{name}: {size / 1000:.1f} kB, {spent:.2f} ms, {differing} differ between processes")


if __name__ == "__main__":
    main()
