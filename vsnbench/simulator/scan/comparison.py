"""Compares a site's scan with its survey: walls, what stands on the floor, and what the survey lacks."""

import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely

from vsnbench.simulator.rendering.scan.mesh import load_scan
from vsnbench.simulator.scan.occupancy import BAND_M, CELL_M, facing_points_on, occupied_points
from vsnbench.site_checks.finding import Severity, SiteFinding, outline, point_text, stretch
from vsnbench.sites.geometry.walls import solid_shapes, top_m
from vsnbench.sites.site import Site, Wall

TOLERANCE_M: Final = 0.05
"""Differences up to this are not reported."""
_WALL_BAND_M: Final = (0.3, 1.9)
_REACH_M: Final = 0.25
_FACES: Final = 0.5
"""Cosine of the angle up to which a surface faces away from a wall."""
_LEAST_SEEN: Final = 0.2
"""Share of a wall's length that a surface must cover to be compared."""
_END_M, _STRETCH_M, _BIN_M = 0.1, 0.05, 0.01
_SMALLEST_M2: Final = 0.02
_MOST: Final = 20

Floats = npt.NDArray[np.float64]


def scan_findings(site: Site) -> list[SiteFinding]:
    """Return where a site's scan and its survey differ by more than 5 cm; nothing without a scan.

    Raises:
        SiteError: the scan cannot be read, or is not the one that the site file names.
    """
    if site.scan is None or site.scan.path is None:
        return []
    samples, facing = _samples(site.scan.path, site.scan.sha256)
    upright = (samples[:, 2] > _WALL_BAND_M[0]) & (samples[:, 2] < _WALL_BAND_M[1])
    walls, facing = samples[upright, :2], facing[upright]
    if site.objects:
        things = shapely.union_all([thing.shape.buffer(0.1) for thing in site.objects])
        bare = ~shapely.contains_xy(things, walls[:, 0], walls[:, 1])
        walls, facing = walls[bare], facing[bare]
    found = [finding for index in range(len(site.walls)) if (finding := _of_wall(site.walls, index, walls, facing))]
    return [*found, *_missing(site, samples), *_unsurveyed(site, samples)]


@lru_cache(maxsize=1)
def _samples(path: Path, sha256: str) -> tuple[Floats, Floats]:
    """Return points on a scan's surfaces, and where they face; the editor asks after each change of a site."""
    return facing_points_on(load_scan(path, sha256))


def _of_wall(walls: Sequence[Wall], index: int, points: Floats, facing: Floats) -> SiteFinding | None:
    """Return the larger difference of a wall's two sides, if it exceeds the tolerance.

    A side of which the scan has no surface is not compared: a scan from inside shows one side of the outer walls.
    """
    wall, worst = walls[index], 0.0
    half = wall.thickness_m / 2
    low, high = np.minimum(wall.start, wall.end), np.maximum(wall.start, wall.end)
    near = ((points > low - half - _REACH_M) & (points < high + half + _REACH_M)).all(axis=1)
    points, facing = points[near], facing[near]
    others = [other.shape for place, other in enumerate(walls) if place != index]
    of_others = shapely.union_all(others).buffer(TOLERANCE_M)
    own = ~shapely.contains_xy(of_others, points[:, 0], points[:, 1])
    points, facing = points[own] - wall.start, facing[own]
    along = (np.array(wall.end) - wall.start) / wall.length_m
    left = np.array([-along[1], along[0]])
    place, across, way = points @ along, points @ left, facing @ left
    inside = (place > _END_M) & (place < wall.length_m - _END_M)
    is_unknown = np.abs(way) + np.abs(facing @ along) < _FACES
    seen = {
        side: inside
        & (np.abs(side * across - half) < _REACH_M)
        & np.where(is_unknown, side * across > 0, side * way > _FACES)
        for side in (-1.0, 1.0)
    }
    least_m = _LEAST_SEEN * max(wall.length_m - 2 * _END_M, _STRETCH_M)
    first_m = math.inf  # where the better seen side is, along its own direction
    for side in sorted(seen, key=lambda side: -_covered_m(place[seen[side]])):
        off = side * across - half
        # The other side is behind it: what faces away in front of it is the back of something else.
        mine = seen[side] & (side * across > -first_m - 2 * _BIN_M)
        if _covered_m(place[mine]) < least_m:
            continue
        at_face = mine & (np.abs(off) <= TOLERANCE_M)
        if _covered_m(place[at_face]) >= least_m:
            first_m = half + float(np.median(off[at_face]))
            continue
        bins = np.bincount(((off[mine] + _REACH_M) / _BIN_M).astype(int), minlength=3)
        most_m = (int(np.argmax(np.convolve(bins, np.ones(3), "same"))) + 0.5) * _BIN_M - _REACH_M
        found_m = float(np.median(off[mine & (np.abs(off - most_m) < 2 * _BIN_M)]))
        first_m = half + found_m
        worst = found_m if abs(found_m) > abs(worst) else worst
    if abs(worst) <= TOLERANCE_M:
        return None
    where = "outside" if worst > 0 else "inside"
    return SiteFinding(
        Severity.WARNING,
        "scan-wall",
        f"wall {index + 1}",
        f"has its surface {abs(worst) * 100:.0f} cm farther {where} in the scan",
        "move the wall, or correct its thickness",
        stretch(wall.start, wall.end),
        abs(worst),
        (("walls", index),),
    )


def _covered_m(places: Floats) -> float:
    """Return the length of a wall along which there are points."""
    return len(np.unique((places / _STRETCH_M).astype(int))) * _STRETCH_M


def _missing(site: Site, samples: Floats) -> list[SiteFinding]:
    """Return the solid objects of the survey where the scan has no surface."""
    findings = []
    for index, thing in enumerate(site.objects):
        low, high = max(thing.elevation_m, BAND_M[0]), top_m(thing) + TOLERANCE_M
        if not thing.solid or high < 2 * BAND_M[0]:
            continue
        shape = thing.shape.buffer(TOLERANCE_M)
        x_min, y_min, x_max, y_max = shape.bounds
        x, y, z = samples.T
        near = (x > x_min) & (x < x_max) & (y > y_min) & (y < y_max) & (z > low) & (z < high)
        if not shapely.contains_xy(shape, x[near], y[near]).any():
            findings.append(
                SiteFinding(
                    Severity.WARNING,
                    "scan-object",
                    thing.id,
                    "is not in the scan",
                    "correct its position, remove it, or scan the place again",
                    outline(thing.shape),
                    entries=(("objects", index),),
                )
            )
    return findings


def _unsurveyed(site: Site, samples: Floats) -> list[SiteFinding]:
    """Return what the scan has in a robot's way, and the survey does not."""
    cells = occupied_points(samples, *BAND_M)
    rooms = shapely.union_all([room.shape for room in site.rooms])
    known = shapely.union_all(solid_shapes(site)).buffer(TOLERANCE_M + CELL_M / 2, join_style="mitre")
    new = shapely.contains_xy(rooms, cells[:, 0], cells[:, 1]) & ~shapely.contains_xy(known, cells[:, 0], cells[:, 1])
    half = CELL_M / 2 + 1e-6
    x, y = cells[new].T
    merged = shapely.union_all(shapely.box(x - half, y - half, x + half, y + half))
    parts = [part for part in shapely.get_parts(merged) if part.area >= _SMALLEST_M2]
    findings = []
    for part in sorted(parts, key=lambda part: -part.area)[:_MOST]:
        x0, y0, x1, y1 = part.bounds
        middle = ((x0 + x1) / 2, (y0 + y1) / 2)
        findings.append(
            SiteFinding(
                Severity.WARNING,
                "scan-unsurveyed",
                f"the scan at {point_text(middle)}",
                f"has something {x1 - x0:.2f} x {y1 - y0:.2f} m that is not in the site file",
                "add it as an object",
                outline(part.envelope),
                math.sqrt(part.area),
            )
        )
    return findings
