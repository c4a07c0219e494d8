"""How well a map by `vsnbench sites scan` shows a site's walls: how much of their length, and how much is proposed.

usage: python benchmarks/scan_accuracy.py [--site apartment | twin:3] [--noise] [--seed N] [--map FILE]

The scan is the command's own, left alone (`--auto`); with --map a map that is there is measured.

A wall is measured along its faces, which is what a camera sees, door openings cut out, point by point of 1 cm:
- on the map: the centre of an occupied cell lies within 5 cm of the face
- proposed: the body of a proposed wall lies within 5 cm of the wall's, and runs along it (10 degrees)
- seen: what a depth camera without noise sees from somewhere on a grid of 40 cm of the places that the robot can reach,
  turning around there; below the scan's height and within its range. What furniture and doors hide from everywhere
  counts under "all" only.
"""

import argparse
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt
import shapely

from vsnbench.exchange.ros_map import read_ros_map
from vsnbench.protocol.free_space import FreeSpace
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site
from vsnbench.robots.profiles import load_profile
from vsnbench.runner.scan import RANGE_M, TOP_M
from vsnbench.runner.selection import named_site
from vsnbench.sensing.plan_grid import OCCUPIED, PlanGrid
from vsnbench.sensing.wall_lines import propose_walls
from vsnbench.simulator.renderer import Renderer
from vsnbench.simulator.scene import build_scene

STEP_M = 0.01
WITHIN_M = 0.05
LOOK_EVERY_M = 0.4
LOWEST_M = 0.2

Points = npt.NDArray[np.float64]


def faces_of(site: Site) -> tuple[Points, Points]:
    """Return (n, 2) points on the walls' faces, metres, and the direction of each one's wall, radians."""
    rooms = shapely.union_all([room.shape for room in site.rooms]).buffer(0.01)
    walls = shapely.union_all([wall.shape for wall in site.walls])
    openings = shapely.union_all([door.centre_line.buffer(0.3, cap_style="flat") for door in site.doors])
    kept, ways = [], []
    for wall in site.walls:
        start, end = np.array(wall.start), np.array(wall.end)
        way = (end - start) / wall.length_m
        normal = np.array([-way[1], way[0]]) * (wall.thickness_m / 2)
        along = np.arange(0, wall.length_m + wall.thickness_m, STEP_M) - wall.thickness_m / 2
        for side in (-1, 1):
            points = start + along[:, None] * way + side * normal
            inside = shapely.contains_xy(rooms, points) & ~shapely.contains_xy(walls.buffer(-1e-3), points)
            inside &= ~shapely.contains_xy(openings, points)
            outside = points + 0.02 * side * normal / np.hypot(*normal)
            inside &= shapely.contains_xy(rooms, outside) & ~shapely.contains_xy(walls, outside)
            kept.append(points[inside])
            ways.append(np.full(int(inside.sum()), math.atan2(way[1], way[0])))
    return np.concatenate(kept), np.concatenate(ways)


def near(points: Points, others: Points, within_m: float) -> npt.NDArray[np.bool_]:
    """Return which points have another within a distance."""
    from scipy.spatial import cKDTree

    if not len(others):
        return np.zeros(len(points), np.bool_)
    return np.asarray(cKDTree(others).query(points, distance_upper_bound=within_m)[0] <= within_m, np.bool_)


def seen_faces(site: Site, profile: RobotProfile, points: Points) -> npt.NDArray[np.bool_]:
    """Return which points of the faces the robot's camera can see at all."""
    import cv2

    space = FreeSpace(site, profile.base.radius_m)
    start = site.starts[0]
    reachable = space.cells & _connected(space.cells, space.cell_of(*start.position))
    skip = round(LOOK_EVERY_M / 0.025)
    rows, columns = np.nonzero(reachable[::skip, ::skip])
    camera = profile.camera.resized(160, 120)
    renderer = Renderer(build_scene(site))
    headings = np.arange(0, math.tau, math.radians(camera.horizontal_fov_deg * 0.9))
    low = points.min(axis=0) - 0.5
    drawn = np.zeros(np.ceil((points.max(axis=0) + 0.5 - low) / STEP_M).astype(int), np.uint8)
    for row, column in zip(rows * skip, columns * skip, strict=True):
        for heading in headings:
            pose = Pose(float(space.x_m[row, column]), float(space.y_m[row, column]), float(heading))
            depth_m = renderer.measure(camera, pose).copy()
            depth_m[(depth_m > RANGE_M) | (depth_m < camera.depth_min_m)] = np.nan
            cloud = camera.points_in_base(depth_m).reshape(-1, 3)
            cloud = cloud[np.isfinite(cloud).all(axis=1) & (cloud[:, 2] > LOWEST_M) & (cloud[:, 2] < TOP_M)]
            turn = np.array([[math.cos(heading), math.sin(heading)], [-math.sin(heading), math.cos(heading)]])
            there = ((cloud[:, :2] @ turn + pose.position - low) / STEP_M).astype(int)
            there = there[((there >= 0) & (there < drawn.shape)).all(axis=1)]
            drawn[there[:, 0], there[:, 1]] = 1
    about = cv2.dilate(drawn, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7)))
    at = ((points - low) / STEP_M).astype(int)
    return np.asarray(about[at[:, 0], at[:, 1]] > 0, np.bool_)


def _connected(cells: npt.NDArray[np.bool_], at: tuple[int, int]) -> npt.NDArray[np.bool_]:
    import cv2

    _, labels = cv2.connectedComponents(cells.astype(np.uint8), connectivity=4)
    return np.asarray(labels == labels[at], np.bool_)


def on_the_map(grid: PlanGrid, points: Points) -> npt.NDArray[np.bool_]:
    """Return which points an occupied cell is near to."""
    rows, columns = np.nonzero(grid.cells == OCCUPIED)
    return near(points, grid.in_site(np.column_stack((columns + 0.5, rows + 0.5))), WITHIN_M)


def proposed(grid: PlanGrid, points: Points, ways: Points) -> npt.NDArray[np.bool_]:
    """Return which points of the faces belong to walls that are proposed."""
    found = np.zeros(len(points), np.bool_)
    for line in propose_walls(grid):
        way = math.atan2(line.end[1] - line.start[1], line.end[0] - line.start[0])
        along = np.abs((ways - way + math.pi / 2) % math.pi - math.pi / 2) < math.radians(10)
        body = shapely.LineString([line.start, line.end]).buffer(line.thickness_m / 2, cap_style="flat")
        found |= along & (shapely.distance(body, shapely.points(points)) <= WITHIN_M)
    return found


def ghosts(grid: PlanGrid, site: Site) -> float:
    """Return which share of the occupied cells lies farther than 5 cm from everything that stands in the site."""
    rows, columns = np.nonzero(grid.cells == OCCUPIED)
    centres = shapely.points(grid.in_site(np.column_stack((columns + 0.5, rows + 0.5))))
    there = [wall.shape for wall in site.walls] + [thing.shape for thing in site.objects]
    away = shapely.distance(shapely.union_all(there), centres)
    return float(np.mean(away > WITHIN_M + grid.resolution_m / 2))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--site", default="apartment")
    parser.add_argument("--noise", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--map", type=Path)
    asked = parser.parse_args()
    site, profile = named_site(asked.site), load_profile("turtlebot2")
    with tempfile.TemporaryDirectory() as folder:
        path = asked.map or Path(folder) / "scan.yaml"
        if asked.map is None:
            words = ["scan", "--auto", "--site", asked.site, "--seed", str(asked.seed), "--output", str(path)]
            subprocess.run(
                [sys.executable, "-m", "vsnbench.cli.main", "sites", *words, *(["--noise"] if asked.noise else [])],
                check=True,
            )
        grid = read_ros_map(path)
    points, ways = faces_of(site)
    seen = seen_faces(site, profile, points)
    mapped, lines = on_the_map(grid, points), proposed(grid, points, ways)
    print(f"{site.name}: {len(points) * STEP_M:.1f} m of faces, {seen.mean():.1%} of them can be seen")
    for name, found in (("on the map within 5 cm", mapped), ("proposed as walls", lines)):
        print(f"{name}: {found[seen].mean():.1%} of what can be seen, {found.mean():.1%} of all")
    print(f"occupied cells where nothing stands: {ghosts(grid, site):.1%}")


if __name__ == "__main__":
    main()
