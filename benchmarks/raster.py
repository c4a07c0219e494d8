"""Measures the time to render RGB, depth and both id images, on one thread.

Renders the camera image at each starting position of the embedded apartment. Prints the median and the slowest view in
milliseconds, and the preparation time of the scene in seconds.

    python benchmarks/raster.py [--repeats 10]
"""

import argparse
import statistics
import time

from vsnbench.simulator.rendering.renderer import Renderer
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import load_site
from vsnbench.values.camera import Camera

SIZES = ((640, 480), (256, 256))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=10)
    repeats = parser.parse_args().repeats
    site = load_site("apartment")
    began = time.perf_counter()
    scene = build_scene(site)
    renderer = Renderer(scene)
    print(f"scene of {len(site.objects)} objects, {len(scene.primitives)} primitives")
    print(f"prepared in {time.perf_counter() - began:.2f} s (light maps, textures)")
    for width, height in SIZES:
        camera = Camera(width=width, height=height, horizontal_fov_deg=79, mount_height_m=0.88)
        views = []
        for start in site.starts:
            renderer.render(camera, start.pose)
            times = []
            for _ in range(repeats):
                before = time.perf_counter()
                renderer.render(camera, start.pose)
                times.append(1e3 * (time.perf_counter() - before))
            views.append(min(times))
        print(f"{width}x{height}: median view {statistics.median(views):.1f} ms, slowest {max(views):.1f} ms")


if __name__ == "__main__":
    main()
