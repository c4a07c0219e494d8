"""Measures VLV's replanning time in ms against scikit-fmm and plain Python.

The map has 401 x 401 cells of 5 cm. Replanning computes the distance field and searches for the next action, for a
sub-goal 3 m away, the farthest that the policy chooses, and for a target at the far end of the map. VLV's planner stops
computing the field soon after it has reached the robot. The baseline computes it for the whole map with
`skfmm.travel_time`, as the original does, and searches in a Python loop over sequences of at most two forward moves
with up to six turns before each.

    python benchmarks/vlv_planning.py [--repetitions N] [--json FILE]
"""

import argparse
import json
import math
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import skfmm

from vsnbench.models.vlv.detectors.contract import Reliability
from vsnbench.models.vlv.planner import Planner, Terrain
from vsnbench.models.vlv.search import Search
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.sensing.occupancy_map import OccupancyMap
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

SIDE_CELLS = 401
SETTINGS = VLVSettings()
POSE = Pose(-7.0, -6.0, 0.4)
TARGETS = {"sub_goal": (-5.0, -4.2), "far_end": (7.0, 6.0)}
_OPEN_CELLS = 24


def furnished_map() -> OccupancyMap:
    """Return a map of 401 x 401 observed cells with rooms and obstacles."""
    grid = OccupancyMap(SETTINGS.mapping)
    random = np.random.default_rng(4)
    evidence = np.full((SIDE_CELLS, SIDE_CELLS), -1.0, np.float32)
    for column in (100, 200, 300):
        evidence[:, column : column + 2] = 5.0
        for door in (40, 180, 330):
            evidence[door : door + 20, column : column + 2] = -1.0
    for _ in range(60):
        row, column = random.integers(10, SIDE_CELLS - 20, 2)
        evidence[row : row + 8, column : column + 12] = 5.0
    for x_m, y_m in (POSE.position, *TARGETS.values()):
        row, column = (int((value + SIDE_CELLS * 0.025) / 0.05) for value in (y_m, x_m))
        evidence[row - _OPEN_CELLS : row + _OPEN_CELLS, column - _OPEN_CELLS : column + _OPEN_CELLS] = -1.0
    grid.origin_x_m = grid.origin_y_m = -SIDE_CELLS * SETTINGS.resolution_m / 2
    grid._evidence = evidence  # noqa: SLF001 - mapping an area of this size takes too long
    grid._observed = np.ones_like(evidence, np.bool_)  # noqa: SLF001
    grid._bumps = np.zeros_like(evidence, np.bool_)  # noqa: SLF001
    return grid


def plain_search(field_m: np.ndarray, terrain: Terrain, pose: Pose) -> tuple[float, int]:
    """Return the cost and the first turns of the best sequence, with loops in Python."""
    best, first = math.inf, 0
    grid = terrain.map
    fan = [0, *(sign * k for k in range(1, 7) for sign in (1, -1))][:12]

    def moved(x_m: float, y_m: float, heading: float) -> tuple[float, float] | None:
        for k in range(1, 11):
            x, y = x_m + math.cos(heading) * 0.025 * k, y_m + math.sin(heading) * 0.025 * k
            if not terrain.is_open(x, y):
                return None
        return x, y

    def left(at: tuple[float, float]) -> float:
        cell = grid.cell_at(*at)
        return float(field_m[cell.row, cell.column]) / 0.25

    for turns in fan:
        there = moved(*pose.position, pose.heading_rad + turns * math.pi / 6)
        if there is None:
            continue
        cost = abs(turns) + 1 + left(there)
        if cost < best:
            best, first = cost, turns
        for more in fan:
            end = moved(*there, pose.heading_rad + (turns + more) * math.pi / 6)
            if end is not None:
                cost = abs(turns) + 1 + abs(more) + 1 + left(end)
                if cost < best:
                    best, first = cost, turns
    return best, first


def timed(work: Callable[[], object], repetitions: int) -> float:
    """Return the median duration in milliseconds."""
    work()
    durations = []
    for _ in range(repetitions):
        begun = time.perf_counter()
        work()
        durations.append((time.perf_counter() - begun) * 1e3)
    return statistics.median(durations)


def compared(terrain: Terrain, target: tuple[float, float], repetitions: int) -> dict[str, float]:
    """Return the durations of both planners for one target, and the largest difference of their fields."""
    grid, planner = terrain.map, Planner(SETTINGS)
    targets = np.zeros(grid.shape, np.bool_)
    cell = grid.cell_at(*target)
    targets[cell.row, cell.column] = True
    route = planner.route(terrain, targets, POSE)
    if route is None:
        raise SystemExit("the map has no path to the target")
    level = np.ma.MaskedArray(np.where(targets, -1.0, 1.0), mask=~terrain.open_cells)
    speed = np.where(terrain.open_cells, grid.resolution_m / terrain.slowness, 1.0)

    def theirs() -> np.ndarray:
        return np.ma.filled(skfmm.travel_time(level, speed, dx=grid.resolution_m, order=1), np.inf)

    field = theirs()
    figures = {
        "field_ms": timed(lambda: planner.route(terrain, targets, POSE), repetitions),
        "search_ms": timed(lambda: planner.next_action(route, POSE), repetitions),
        "skfmm_field_ms": timed(theirs, repetitions),
        "python_search_ms": timed(lambda: plain_search(field, terrain, POSE), repetitions),
    }
    ours = figures["field_ms"] + figures["search_ms"]
    figures["share"] = ours / (figures["skfmm_field_ms"] + figures["python_search_ms"])
    both = np.isfinite(route.field_m) & np.isfinite(field)
    figures["largest_field_difference_m"] = float(np.abs(route.field_m[both] - field[both]).max())
    return figures


def scan_ms() -> float:
    """Return the milliseconds of a full scan: twelve 640 x 480 depth images, candidates and choice."""
    camera = Camera(width=640, height=480, horizontal_fov_deg=60, mount_height_m=0.6, depth_min_m=0.4, depth_max_m=8)
    down = (np.arange(480) - 239.5) / camera.focal_px
    with np.errstate(divide="ignore"):
        column = np.minimum(np.where(down > 0, 0.6 / down, np.inf), 3.0)
    depth = np.repeat(column.astype(np.float32)[:, None], 640, axis=1)
    rgb = np.zeros((480, 640, 3), np.uint8)

    def scan() -> None:
        search = Search(SETTINGS, Planner(SETTINGS), 1, Reliability(SETTINGS.detector_threshold))
        for k in range(13):
            search.step(Observation(rgb, depth, Pose(0, 0, k * math.pi / 6), 0.0, camera), (), 0.0)

    return timed(scan, 3)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=15)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    grid, planner = furnished_map(), Planner(SETTINGS)
    terrain = planner.terrain(grid, POSE, 0.0)
    figures = {"terrain_ms": timed(lambda: planner.terrain(grid, POSE, 0.0), arguments.repetitions)}
    for name, target in TARGETS.items():
        figures |= {f"{name}_{key}": value for key, value in compared(terrain, target, arguments.repetitions).items()}
    figures["scan_ms"] = scan_ms()
    for name, value in figures.items():
        print(f"{name:38s} {value:9.3f}")
    share = figures["sub_goal_share"]
    print(f"replanning to a sub-goal takes {share:.2f} of scikit-fmm and Python (wanted: at most 0.33)")
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
