"""The COCO detector of `vsnbench models fetch coco-detector`: precision and recall by class, misses, and speed.

`views` renders random views of generated flats (not of the apartment, which is the test site) and compares boxes with
the simulator's labels: a box is correct if its intersection over union with a visible object of its class is at least
0.3. The minimum scores and the reliability in the converted file follow from this. `frames` compares the classes found
in frames of a scanned house with those that a person sees. `speed` times a frame on one thread.

    python benchmarks/coco_detector.py views [--flats 9200-9239] [--count 50] [--detector FILE] [--json FILE]
    python benchmarks/coco_detector.py frames DIRECTORY [--detector FILE]
    python benchmarks/coco_detector.py figure PATH [--detector FILE]
    python benchmarks/coco_detector.py speed [--detector FILE]
"""

import argparse
import itertools
import json
import math
import statistics
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import cv2
import numpy as np

from benchmarks.support.coco_network import Found, Network, overlap
from benchmarks.support.goal_views import SMALLEST_SHARE, Flat, Visible
from benchmarks.support.recognition import LEAST_OVERLAP
from vsnbench.models.checkpoints.weights import weights_directory
from vsnbench.models.vlv.detectors.choosing import ONNX_FILE
from vsnbench.models.vlv.goals import CLASS_OF_GOAL
from vsnbench.simulator.generated_sites.generate import generate_site
from vsnbench.values.pose import Pose

CLASSES = tuple(sorted(CLASS_OF_GOAL.values()))
SCORES = (0.15, 0.20, 0.25, 0.30, 0.35, 0.40, 0.45, 0.50)
RANGE_M = 5.0
"""Objects farther away do not count as missed; the map ends there."""

FIGURE_FLATS = range(9300, 9304)
SHOWN = {
    "bed": {"ep96": range(2, 10)},
    "chair": {"ep19": range(1, 10), "ep29": range(10), "ep97": range(3)},
    "couch": {"ep19": range(4, 10), "ep29": range(2, 3), "ep59": range(7, 10), "ep97": (0, 9)},
    "dining table": {"ep19": (1, 2, 3, 4, 5, 6, 9), "ep29": range(2, 10)},
    "toilet": {"ep96": range(2, 10)},
}
"""What a person sees in the frames of gramuah/ros4vsn, examples/pirlnav/imgs at commit c0887e9: a scan of a real house.
Bar stools are chairs, a coffee table is not a dining table, and slivers at the edge do not count."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--detector", type=Path, default=weights_directory() / ONNX_FILE)
    parser.add_argument("--json", type=Path)
    modes = parser.add_subparsers(dest="mode", required=True)
    views = modes.add_parser("views")
    views.add_argument("--flats", default="9200-9239")
    views.add_argument("--count", type=int, default=50)
    modes.add_parser("frames").add_argument("directory", type=Path)
    modes.add_parser("figure").add_argument("path", type=Path)
    modes.add_parser("speed")
    options = parser.parse_args()
    network = Network(options.detector)
    if options.mode == "views":
        first, last = (int(seed) for seed in options.flats.split("-"))
        measured = measure_views(network, range(first, last + 1), options.count)
    elif options.mode == "frames":
        measured = measure_frames(network, options.directory)
    elif options.mode == "figure":
        measured = draw_figure(network, options.path)
    else:
        measured = measure_speed(network)
    print(json.dumps(measured, indent=1))
    if options.json:
        options.json.write_text(json.dumps(measured))


def measure_views(network: Network, seeds: Iterable[int], count: int) -> dict[str, object]:
    """Return precision and recall by class and score, and the reliability for the converter."""
    rows: list[tuple[list[Visible], list[Found]]] = []
    for seed in seeds:
        rows += [(seen, network.find(rgb, SCORES[0])) for rgb, seen in views_of(seed, count)]
        print(f"flat {seed}: {len(rows)} views", flush=True)
    table = {label: {str(score): precision_and_recall(rows, label, score) for score in SCORES} for label in CLASSES}
    return {"views": len(rows), "table": table, "reliability": reliability(table)}


def views_of(seed: int, count: int) -> Iterator[tuple[np.ndarray, list[Visible]]]:
    """Yield views from random free poses of a generated flat, with the visible objects of VLV's goals."""
    flat = Flat(generate_site(seed))
    random = np.random.default_rng([7, seed])
    free = np.argwhere(flat.space.cells)
    for row, column in free[random.choice(len(free), count, replace=False)]:
        heading_rad = float(random.uniform(-math.pi, math.pi))
        view = flat.view(Pose(float(flat.space.x_m[row, column]), float(flat.space.y_m[row, column]), heading_rad))
        yield (
            view.rgb,
            [item for item in view.objects if item.category in CLASS_OF_GOAL and item.share >= SMALLEST_SHARE],
        )


def precision_and_recall(
    rows: list[tuple[list[Visible], list[Found]]], label: str, least: float
) -> dict[str, float | int]:
    correct = boxes = hit = visible = 0
    for seen, found in rows:
        objects = [item for item in seen if CLASS_OF_GOAL[item.category] == label]
        hits: set[int] = set()
        for item in found:
            if item.label == label and item.score >= least:
                covered = {k for k, thing in enumerate(objects) if overlap(item.box, thing.box) >= LEAST_OVERLAP}
                boxes, correct = boxes + 1, correct + bool(covered)
                hits |= covered
        near = {k for k, thing in enumerate(objects) if thing.distance_m < RANGE_M}
        visible, hit = visible + len(near), hit + len(near & hits)
    return {
        "boxes": boxes,
        "precision": round(correct / boxes, 3) if boxes else 0.0,
        "visible": visible,
        "recall": round(hit / visible, 3) if visible else 0.0,
    }


def reliability(table: dict[str, dict[str, dict[str, float | int]]]) -> dict[str, dict[str, float]]:
    """Return the minimum score with the best F1 of each class, with its precision and recall."""
    chosen = {}
    for label, by_score in table.items():
        score = max(by_score, key=lambda score: f1(by_score[score]))
        cell = by_score[score]
        chosen[label] = {"threshold": float(score), "precision": cell["precision"], "recall": cell["recall"]}
    return chosen


def f1(cell: dict[str, float | int]) -> float:
    precision, recall = cell["precision"], cell["recall"]
    return 2 * precision * recall / (precision + recall) if precision else 0.0


def measure_frames(network: Network, directory: Path) -> dict[str, object]:
    """Return how many frames show a class, and in how many frames it is found."""
    paths = sorted(directory.glob("ep*/*.png"))
    rows = {
        f"{path.parent.name}/{path.stem}": network.find(cv2.imread(str(path))[..., ::-1], SCORES[0]) for path in paths
    }
    table: dict[str, dict[str, object]] = {}
    for label in CLASSES:
        shown = {f"{episode}/{k}" for episode, numbers in SHOWN[label].items() for k in numbers}
        table[label] = {"frames that show it": len(shown & set(rows))}
        for least in (*SCORES, None):
            limit = network.threshold(label) if least is None else least
            names = {name for name, found in rows.items() if any(found_as(item, label, limit) for item in found)}
            cell = {"found": len(names & shown), "false": sorted(names - shown)}
            table[label][f"own, {limit}" if least is None else str(least)] = cell
    return {"frames": len(rows), "table": table}


def found_as(item: Found, label: str, least: float) -> bool:
    return item.label == label and item.score >= least


def draw_figure(network: Network, path: Path) -> dict[str, object]:
    """Draw 12 views of generated flats with a goal in range; correct boxes are green, others red."""
    cells = []
    counts = {"correct": 0, "false": 0, "missed": 0}
    for seed in FIGURE_FLATS:
        with_goal = (view for view in views_of(seed, 30) if any(thing.distance_m < RANGE_M for thing in view[1]))
        for rgb, seen in itertools.islice(with_goal, 12 // len(FIGURE_FLATS)):
            image = rgb[..., ::-1].copy()
            hit: set[int] = set()
            for item in network.find(rgb, 0.05):
                if item.label not in CLASSES or item.score < network.threshold(item.label):
                    continue
                same = {k for k, thing in enumerate(seen) if CLASS_OF_GOAL[thing.category] == item.label}
                covered = {k for k in same if overlap(item.box, seen[k].box) >= LEAST_OVERLAP}
                hit |= covered
                counts["correct" if covered else "false"] += 1
                left, top, right, bottom = map(round, item.box)
                colour = (60, 180, 60) if covered else (50, 50, 230)
                cv2.rectangle(image, (left, top), (right, bottom), colour, 4)
                place = (left + 6, max(top, 0) + 26)
                cv2.putText(image, f"{item.label} {item.score:.2f}", place, cv2.FONT_HERSHEY_SIMPLEX, 0.8, colour, 2)
            counts["missed"] += sum(thing.distance_m < RANGE_M and k not in hit for k, thing in enumerate(seen))
            cells.append(cv2.resize(image, (320, 240), interpolation=cv2.INTER_AREA))
    rows = [np.hstack(cells[k : k + 4]) for k in range(0, 12, 4)]
    cv2.imwrite(str(path), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 75])
    return counts


def measure_speed(network: Network) -> dict[str, object]:
    """Return the time of a frame on one thread; processor time is not lengthened by other programs."""
    image = np.random.default_rng(1).integers(0, 256, (480, 640, 3), np.uint8)
    network.find(image, 0.5)
    wall_s, processor_s = [], []
    for _ in range(100):
        start_s, used_s = time.perf_counter(), time.process_time()
        network.find(image, 0.5)
        wall_s.append(time.perf_counter() - start_s)
        processor_s.append(time.process_time() - used_s)
    median_s = statistics.median(processor_s)
    return {
        "median_ms": round(1e3 * statistics.median(wall_s), 1),
        "median_processor_ms": round(1e3 * median_s, 1),
        "frames_per_s_of_a_core": round(1 / median_s, 1),
    }


if __name__ == "__main__":
    main()
