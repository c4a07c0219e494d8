"""Writes views of a site's objects, drawn from its scan and from its survey, for a detector outside of the project.

Each object of a category of COCO is seen from free places at 1 to 4.5 m, from the same poses in both. A view is
`NUMBER-scan.rgb` and `NUMBER-drawn.rgb` (480 x 640 x 3 bytes); `truth.json` has category, distance and the box of the
object's visible pixels (x, y, width, height) of each. `--detections FILE` (a JSON object: file name to a list of class,
score and box) prints the recall by class instead.

    python benchmarks/scan_views.py SITE.yaml FOLDER [--views 6] [--detections FILE] [--score 0.3] [--overlap 0.3]
"""

import argparse
import json
import math
from collections import defaultdict
from pathlib import Path

import numpy as np

from vsnbench.protocol.free_space import free_space
from vsnbench.simulator.rendering.renderer import Eye, Renderer
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import Site, load_site

WIDTH, HEIGHT, FOCAL, EYE_M = 640, 480, 388.0, 0.88
COCO = {
    "chair": "chair",
    "sofa": "couch",
    "bed": "bed",
    "table": "dining table",
    "monitor": "tv",
    "toilet": "toilet",
    "plant": "potted plant",
    "refrigerator": "refrigerator",
    "sink": "sink",
}
NEAREST_M, FARTHEST_M, LEAST_PIXELS = 1.0, 4.5, 1500


def write_views(site: Site, folder: Path, views: int) -> None:
    space = free_space(site, 0.18)
    rows, columns = np.nonzero(space.cells)
    places = np.column_stack([space.x_m[rows, columns], space.y_m[rows, columns]])
    drawers = {
        "scan": Renderer(build_scene(site)),
        "drawn": Renderer(build_scene(site.model_copy(update={"scan": None}))),
    }
    rng = np.random.default_rng(0)
    truth: list[dict[str, object]] = []
    for index, thing in enumerate(site.objects):
        if thing.category not in COCO:
            continue
        off = np.asarray(thing.position) - places
        distance = np.hypot(*off.T)
        near = np.flatnonzero((distance > NEAREST_M) & (distance < FARTHEST_M))
        taken = 0
        for place in rng.permutation(near)[:60]:
            heading = math.atan2(off[place, 1], off[place, 0]) + rng.uniform(-0.25, 0.25)
            middle_m = thing.elevation_m + thing.size_m[2] / 2
            tilt = max(min(math.atan2(middle_m - EYE_M, distance[place]), 0.0), -0.35)
            eye = Eye(float(places[place, 0]), float(places[place, 1]), EYE_M, heading, tilt)
            looks = {name: drawer.render_from(eye, WIDTH, HEIGHT, FOCAL) for name, drawer in drawers.items()}
            visible = looks["drawn"].instance == index + 1
            if visible.sum() < LEAST_PIXELS:
                continue
            y, x = np.nonzero(visible)
            number = len(truth)
            box = [int(x.min()), int(y.min()), int(np.ptp(x)) + 1, int(np.ptp(y)) + 1]
            truth.append({"class": COCO[thing.category], "distance_m": float(distance[place]), "box": box})
            for name, look in looks.items():
                (folder / f"{number:03}-{name}.rgb").write_bytes(look.rgb.tobytes())
            taken += 1
            if taken == views:
                break
    (folder / "truth.json").write_text(json.dumps(truth))


def overlap(one: list[float], other: list[float]) -> float:
    """Return intersection over union of two boxes."""
    wide = min(one[0] + one[2], other[0] + other[2]) - max(one[0], other[0])
    high = min(one[1] + one[3], other[1] + other[3]) - max(one[1], other[1])
    shared = max(wide, 0.0) * max(high, 0.0)
    return shared / (one[2] * one[3] + other[2] * other[3] - shared)


def print_recall(folder: Path, detections: dict[str, list[dict]], score: float, least: float) -> None:
    truth = json.loads((folder / "truth.json").read_text())
    found: dict[tuple[str, str], list[bool]] = defaultdict(list)
    for number, entry in enumerate(truth):
        for name in ("scan", "drawn"):
            hit = any(
                each["class"] == entry["class"]
                and each["score"] >= score
                and overlap(each["bbox"], entry["box"]) >= least
                for each in detections[f"{number:03}-{name}"]
            )
            for key in (entry["class"], "all"):
                found[key, name].append(hit)
    print("| class | views | scan | drawn twin |\n| --- | ---: | ---: | ---: |")
    for key in [*sorted({entry["class"] for entry in truth}), "all"]:
        scan, drawn = found[key, "scan"], found[key, "drawn"]
        print(f"| {key} | {len(scan)} | {sum(scan)} ({np.mean(scan):.0%}) | {sum(drawn)} ({np.mean(drawn):.0%}) |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("site", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--views", type=int, default=6)
    parser.add_argument("--detections", type=Path)
    parser.add_argument("--score", type=float, default=0.3)
    parser.add_argument("--overlap", type=float, default=0.3)
    chosen = parser.parse_args()
    if chosen.detections:
        print_recall(chosen.folder, json.loads(chosen.detections.read_text()), chosen.score, chosen.overlap)
        return
    chosen.folder.mkdir(parents=True, exist_ok=True)
    write_views(load_site(chosen.site), chosen.folder, chosen.views)


if __name__ == "__main__":
    main()
