"""Recomputes the progress of recorded episodes without vsnbench's code.

    python benchmarks/progress_recomputed.py RECORD [RECORD ...]     results directories with SQLite records

It reads the site's JSON, the robot's radius and the start and end poses from the record, and compares its shortest
paths (m) and progress with the recorded ones. It runs Dijkstra's algorithm on a grid of 2.5 cm cells. A cell is free
where the base's disk touches no wall (except at open doors) and no solid object below 1.2 m. Edges go in 32 directions,
so a path is at most 0.7 % longer than the straight line. The success region consists of the cells within 1 m of a point
of the goal's outline, on a straight line that crosses no wall.
"""

import json
import math
import sqlite3
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

CELL_M, LOW_M, OUTLINE_M = 0.025, 1.2, 0.05
ALIASES = {"couch": "sofa", "potted plant": "plant", "tv_monitor": "monitor", "tv": "monitor", "dining table": "table"}
Floats = npt.NDArray[np.float64]


def segment_distance(x: Floats, y: Floats, a: Any, b: Any) -> Floats:
    """Return the distances of points from a segment."""
    (ax, ay), (bx, by) = a, b
    length = (bx - ax) ** 2 + (by - ay) ** 2
    t = np.clip(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length, 0, 1) if length else np.zeros_like(x)
    return np.hypot(x - ax - t * (bx - ax), y - ay - t * (by - ay))


def polygon_distance(x: Floats, y: Floats, corners: Floats) -> Floats:
    """Return the distances of points from a polygon, 0 inside."""
    edges = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    inside = np.zeros(x.shape, bool)
    for (ax, ay), (bx, by) in edges:
        inside ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / ((by - ay) or 1e-12))
    return np.where(inside, 0.0, np.min([segment_distance(x, y, a, b) for a, b in edges], axis=0))


def rectangle(centre: Any, along: tuple[float, float], half_length: float, half_width: float) -> Floats:
    """Return the corners of a rectangle."""
    (cx, cy), (ux, uy) = centre, along
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    return np.array(
        [
            (cx + s * half_length * ux - t * half_width * uy, cy + s * half_length * uy + t * half_width * ux)
            for s, t in signs
        ]
    )


class Ground:
    """Grid of a site's free cells and walls."""

    def __init__(self, site: dict[str, Any], radius_m: float) -> None:
        self.site = site
        corners = np.concatenate([np.array(room["polygon"]) for room in site["rooms"]])
        self.low = corners.min(0)
        size = np.ceil((corners.max(0) - self.low) / CELL_M).astype(int) + 1
        self.x, self.y = np.meshgrid(
            self.low[0] + CELL_M * np.arange(size[0]), self.low[1] + CELL_M * np.arange(size[1])
        )
        rooms = np.min([polygon_distance(self.x, self.y, np.array(r["polygon"])) for r in site["rooms"]], axis=0)
        solid_m = np.full(self.x.shape, np.inf)
        self.walls = [piece for wall in site["walls"] for piece in self.pieces(wall)]
        for piece in self.walls:
            solid_m = np.minimum(solid_m, polygon_distance(self.x, self.y, piece))
        for thing in site["objects"]:
            if thing["solid"] and thing["elevation_m"] < LOW_M:
                solid_m = np.minimum(solid_m, polygon_distance(self.x, self.y, self.outline(thing)))
        self.free = (rooms <= 1e-6) & (solid_m >= radius_m)
        self.wall = np.min([polygon_distance(self.x, self.y, piece) for piece in self.walls], axis=0) <= 0
        number = np.full(self.free.shape, -1)
        number[self.free] = np.arange(self.free.sum())
        self.number, self.graph = number, self.edges(number)

    def pieces(self, wall: dict[str, Any]) -> list[Floats]:
        """Return the rectangles of a wall between its open doors."""
        a, b = np.array(wall["start"]), np.array(wall["end"])
        length, half = float(np.hypot(*(b - a))), wall["thickness_m"] / 2
        u = (b - a) / length
        gaps = []
        for door in self.site["doors"]:
            ends = [np.array(door["start"]) - a, np.array(door["end"]) - a]
            if not door["closed"] and all(abs(u[0] * e[1] - u[1] * e[0]) < 0.05 for e in ends):
                gaps.append(sorted(float(u @ e) for e in ends))
        pieces, begin = [], -half
        for low, high in [*sorted(gaps), [length + half, length + half]]:
            if low > begin:
                middle = a + u * (begin + low) / 2
                pieces.append(rectangle(middle, (u[0], u[1]), (low - begin) / 2, half))
            begin = max(begin, high)
        return pieces

    def outline(self, thing: dict[str, Any]) -> Floats:
        """Return the corners of an object's footprint."""
        if thing["footprint"]:
            return np.array(thing["footprint"])
        turn = math.radians(thing["heading_deg"])
        depth, width, _ = thing["size_m"]
        return rectangle(thing["position"], (math.cos(turn), math.sin(turn)), depth / 2, width / 2)

    def edges(self, number: npt.NDArray[np.int64]) -> Any:
        """Return the graph of free cells, with edges in 32 directions that cross only free cells."""
        steps = [(0, 1), (1, 0), (1, 1), (-1, 1), (1, 2), (2, 1), (-1, 2), (-2, 1)]
        steps += [(1, 3), (3, 1), (-1, 3), (-3, 1), (2, 3), (3, 2), (-2, 3), (-3, 2)]
        rows, columns = number.shape
        ends: list[list[Any]] = [[], [], []]
        for down, right in steps:
            at = np.argwhere(number >= 0)
            to = at + np.array((down, right))
            fits = (to[:, 0] >= 0) & (to[:, 0] < rows) & (to[:, 1] < columns)
            for share in np.linspace(0, 1, 5)[1:]:
                cell = np.rint(at + share * np.array([down, right])).astype(int)
                cell = np.clip(cell, 0, (rows - 1, columns - 1))
                fits &= number[cell[:, 0], cell[:, 1]] >= 0
            ends[0].append(number[at[fits, 0], at[fits, 1]])
            ends[1].append(number[to[fits, 0], to[fits, 1]])
            ends[2].append(np.full(int(fits.sum()), CELL_M * math.hypot(down, right)))
        first, second, length = (np.concatenate(part) for part in ends)
        return coo_matrix((length, (first, second)), shape=(int(number.max()) + 1,) * 2).tocsr()

    def ways_m(self, goal: str, within_m: float) -> Floats:
        """Return the shortest path in metres from each free cell to the success region of a category."""
        reached = np.zeros(self.free.shape, bool)
        for thing in self.site["objects"]:
            if ALIASES.get(thing["category"], thing["category"]) != goal:
                continue
            corners = self.outline(thing)
            near = self.free & (polygon_distance(self.x, self.y, corners) < within_m)
            outline = []
            for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
                steps = max(2, math.ceil(np.hypot(*(b - a)) / OUTLINE_M))
                outline += [a + (b - a) * share for share in np.linspace(0, 1, steps)]
            points = np.array(outline)
            for row, column in np.argwhere(near):
                here = np.array([self.x[row, column], self.y[row, column]])
                close = points[np.hypot(*(points - here).T) < within_m]
                reached[row, column] |= any(self.sees(here, point) for point in close)
        sources = self.number[reached]
        ways = np.full(self.free.shape, np.inf)
        if len(sources):
            ways[self.free] = dijkstra(self.graph, directed=False, indices=sources, min_only=True)
        return ways

    def sees(self, here: Floats, there: Floats) -> bool:
        """Return whether the line between two points crosses no wall cell."""
        count = max(2, math.ceil(np.hypot(*(there - here)) / (CELL_M / 2)))
        line = here + (there - here) * np.linspace(0, 1, count)[:-1, None]
        cells = np.rint((line - self.low) / CELL_M).astype(int)
        cells = np.clip(cells, 0, (self.wall.shape[1] - 1, self.wall.shape[0] - 1))
        return not self.wall[cells[:, 1], cells[:, 0]].any()

    def from_pose(self, ways: Floats, x_m: float, y_m: float, reach_m: float) -> float:
        """Return the shortest path in metres from a position, through a cell within `reach_m`."""
        apart = np.hypot(self.x - x_m, self.y - y_m)
        near = apart <= CELL_M if (self.free & (apart <= CELL_M)).any() else apart <= reach_m
        return float(np.min(np.where(near, ways + apart, np.inf)))


def main() -> None:
    """Compare all episodes of the records on the command line."""
    grounds: dict[str, Ground] = {}
    rows = []

    @cache
    def ways(site: str, goal: str, within_m: float) -> Floats:
        return grounds[site].ways_m(goal, within_m)

    for record in sys.argv[1:]:
        with sqlite3.connect(f"file:{Path(record) / 'vsnbench.db'}?mode=ro", uri=True) as database:
            found = database.execute(
                "select e.id, m.name, s.sha256, s.content, r.profile, c.protocol, t.goal, e.geodesic_start_m, "
                "e.geodesic_end_m, e.start_x_m, e.start_y_m, e.final_x_m, e.final_y_m from episode e "
                "join trial t on t.id = e.trial_id join campaign c on c.id = t.campaign_id "
                "join site s on s.id = c.site_id join robot r on r.id = c.robot_id join model m on m.id = c.model_id "
                "where e.geodesic_start_m is not null and e.geodesic_end_m is not null and t.goal_id is null "
                "order by e.id"
            ).fetchall()
        for number, model, sha256, content, profile, protocol, goal, shortest, remaining, *poses in found:
            radius_m = json.loads(profile)["base"]["radius_m"]
            if sha256 not in grounds:
                grounds[sha256] = Ground(json.loads(content), radius_m)
            field = ways(sha256, goal, json.loads(protocol).get("success_distance_m", 1.0))
            start_m = grounds[sha256].from_pose(field, *poses[:2], 0.1)
            end_m = grounds[sha256].from_pose(field, *poses[2:], radius_m + 0.1)
            recorded, own = (
                (1.0 if left <= 0 else 0.0) if way <= 0 else min(1.0, max(0.0, 1 - left / way))
                for way, left in ((shortest, remaining), (start_m, end_m))
            )
            rows.append((record, number, model, goal, shortest, start_m, remaining, end_m, recorded, own))
    lengths = np.array([(row[5] - row[4], row[7] - row[6]) for row in rows])
    apart = np.array([row[9] - row[8] for row in rows])
    long = np.array([row[4] >= 0.5 for row in rows])
    print(f"{len(rows)} episodes in {len(grounds)} sites, {int(long.sum())} with a shortest path of at least 0.5 m")
    print(f"shortest paths: mean difference {lengths.mean():+.3f} m, largest {np.abs(lengths).max():.3f} m")
    for name, chosen in (("all", apart), ("shortest path of at least 0.5 m", apart[long])):
        size = np.abs(chosen)
        print(
            f"progress, {name}: median {np.median(size):.4f}, 95th percentile {np.quantile(size, 0.95):.4f}, largest "
            f"{size.max():.4f}; {np.mean(size <= 0.03):.1%} within 0.03"
        )
    for row, difference in sorted(zip(rows, apart, strict=True), key=lambda pair: -abs(pair[1]))[:5]:
        print(f"  {difference:+.3f}: episode {row[1]} of {row[0]}, {row[2]}, {row[3]}: {row[4:8]}")


if __name__ == "__main__":
    main()
