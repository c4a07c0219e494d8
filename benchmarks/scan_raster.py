"""Measures the processor time to draw a scan: RGB, depth and labels at 640 x 480, on one thread.

The surfaces of the embedded apartment are cut into the given number of textured triangles, with noise of 3 mm; every
second surface is seen from behind. Splats are as wide as triangles. Prints the median and the slowest of 15 starting
positions, the preparation of the scan, and the memory that it takes. `--digest` prints a hash of all pixels, which is
the same on every machine.

    python benchmarks/scan_raster.py [--triangles 50000 500000] [--splats 300000] [--repeats 5] [--digest]
"""

import argparse
import hashlib
import statistics
import time
from dataclasses import replace

import numpy as np
import psutil

from vsnbench.simulator.rendering.mesh import build_mesh
from vsnbench.simulator.rendering.renderer import camera_axes, eye_of
from vsnbench.simulator.rendering.scan.drawing import ScanDrawer
from vsnbench.simulator.rendering.scan.mesh import ScanMesh
from vsnbench.simulator.rendering.scan.splats import Splats
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import Site, load_site
from vsnbench.values.camera import Camera

CAMERA = Camera(width=640, height=480, horizontal_fov_deg=79, mount_height_m=0.88)
SIDE = 2048


def cut(site: Site, triangles: int) -> ScanMesh:
    """Return the site's surfaces as about that many textured triangles."""
    corners = build_mesh(build_scene(site)).corners
    low, high = 0.002, 2.0
    for _ in range(30):
        cell_m = (low * high) ** 0.5
        low, high = (low, cell_m) if 2 * counts(corners, cell_m).prod(axis=1).sum() < triangles else (cell_m, high)
    cells = []
    for columns, rows in np.unique(counts(corners, cell_m), axis=0):
        these = corners[(counts(corners, cell_m) == (columns, rows)).all(axis=1)]
        s, t = np.linspace(0, 1, columns + 1)[None, :, None], np.linspace(0, 1, rows + 1)[:, None, None]
        a, b, c, d = (these[:, k, None, None, :] for k in range(4))
        grid = (a * (1 - s) + b * s) * (1 - t) + (d * (1 - s) + c * s) * t
        square = np.stack([grid[:, :-1, :-1], grid[:, :-1, 1:], grid[:, 1:, 1:], grid[:, 1:, :-1]], axis=3)
        cells.append(square.reshape(-1, 4, 3))
    points, index = np.unique(np.round(np.concatenate(cells).reshape(-1, 3), 4), axis=0, return_inverse=True)
    rng = np.random.default_rng(0)
    points = points + rng.normal(0, 0.003, points.shape)
    faces = index.reshape(-1, 4)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    uv = points[faces][..., :2] * 0.13 % 1.0 + points[faces][..., 2:] * 0.05
    texture = rng.integers(0, 256, (SIDE // 8, SIDE // 8, 3)).repeat(8, 0).repeat(8, 1).astype(np.uint8)
    return ScanMesh(
        points.astype(np.float32),
        faces.astype(np.int32),
        np.full((len(points), 3), 128, np.uint8),
        np.zeros(len(faces), np.int32),
        uv.astype(np.float32),
        (texture,),
    )


def as_splats(mesh: ScanMesh) -> ScanMesh:
    """Return the same scan with a flat splat on each triangle."""
    corners = mesh.corners.astype(np.float64)
    middles = corners.mean(axis=1)
    off = corners - middles[:, None]
    spread = np.einsum("tki,tkj->tij", off, off).reshape(-1, 9)[:, [0, 1, 2, 4, 5, 8]] * 0.6
    paint = np.random.default_rng(1).integers(0, 256, (len(corners), 4))
    paint[:, 3] = 242
    splats = Splats(middles.astype(np.float32), spread.astype(np.float32), paint.astype(np.uint8))
    return replace(mesh, splats=splats)


def counts(corners: np.ndarray, cell_m: float) -> np.ndarray:
    sides = [np.linalg.norm(corners[:, k] - corners[:, (k + 1) % 4], axis=1) for k in range(4)]
    pairs = np.stack([np.maximum(sides[0], sides[2]), np.maximum(sides[1], sides[3])], axis=1)
    return np.maximum(np.ceil(pairs / cell_m), 1).astype(int)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--triangles", type=int, nargs="+", default=[50_000, 500_000])
    parser.add_argument("--splats", type=int, nargs="*", default=[])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--digest", action="store_true")
    options = parser.parse_args()
    site = load_site("apartment")
    rgb, depth = np.empty((480, 640, 3), np.uint8), np.empty((480, 640), np.float32)
    instance = np.empty((480, 640), np.int32)
    cases = [*((number, False) for number in options.triangles), *((number, True) for number in options.splats)]
    for triangles, splats in cases:
        mesh = as_splats(cut(site, triangles)) if splats else cut(site, triangles)
        memory = psutil.Process().memory_info().rss
        began = time.process_time()
        drawer = ScanDrawer(mesh)
        prepared_s = time.process_time() - began
        grown = (psutil.Process().memory_info().rss - memory) / 2**20
        drawer.survey(site.objects)
        pixels = hashlib.sha256()
        parts: dict[str, list[float]] = {"look": [], "depth alone": [], "labels": []}
        for start in site.starts:
            eye = eye_of(CAMERA, start.pose)
            view = (np.array([eye.x_m, eye.y_m, eye.z_m]), camera_axes(eye), CAMERA.focal_px, 319.5, 239.5)
            calls = {
                "look": lambda view=view, drawer=drawer: drawer.look(view, rgb, depth),
                "depth alone": lambda view=view, drawer=drawer: drawer.measure(view, (480, 640)),
                "labels": lambda view=view, drawer=drawer: drawer.label(view, depth, instance),
            }
            for name, call in calls.items():
                call()
                times = []
                for _ in range(options.repeats):
                    began = time.process_time()
                    call()
                    times.append(1e3 * (time.process_time() - began))
                parts[name].append(min(times))
            pixels.update(rgb.tobytes() + depth.tobytes() + instance.tobytes())
        said = ", ".join(f"{name} {statistics.median(ms):.1f} ({max(ms):.1f})" for name, ms in parts.items())
        count = f"{len(mesh.faces):,} {'splats' if splats else 'triangles'}"
        print(f"{count}: {said} ms; prepared in {prepared_s:.2f} s, {grown:.0f} MiB")
        if options.digest:
            print(f"  pixels {pixels.hexdigest()[:16]}")


if __name__ == "__main__":
    main()
