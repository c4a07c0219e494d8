"""Compares a site's scan with its survey: walls, what stands on the floor, and what the survey lacks."""

import math
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely

from vsnbench.simulator.rendering.scan.mesh import load_scan
from vsnbench.simulator.scan.occupancy import BAND_M, CELL_M, occupied_points, points_on, surface_offsets
from vsnbench.site_checks.finding import Severity, SiteFinding, outline, point_text, stretch
from vsnbench.sites.geometry.walls import solid_shapes, top_m
from vsnbench.sites.site import Site, Wall

TOLERANCE_M: Final = 0.05
"""Differences up to this are not reported."""
_WALL_BAND_M: Final = (0.3, 1.9)
_REACH_M: Final = 0.25
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
    samples = _samples(site.scan.path, site.scan.sha256)
    things = shapely.union_all([thing.shape.buffer(0.1) for thing in site.objects])
    is_thing = shapely.contains_xy(things, samples[:, 0], samples[:, 1]) if site.objects else np.zeros(0, np.bool_)
    walls = samples[~is_thing] if is_thing.size else samples
    walls = walls[(walls[:, 2] > _WALL_BAND_M[0]) & (walls[:, 2] < _WALL_BAND_M[1])]
    found = [finding for index, wall in enumerate(site.walls) if (finding := _of_wall(wall, index, walls))]
    return [*found, *_missing(site, samples), *_unsurveyed(site, samples)]


@lru_cache(maxsize=1)
def _samples(path: Path, sha256: str) -> Floats:
    """Return points on a scan's surfaces; the editor asks for them after each change of a site."""
    return points_on(load_scan(path, sha256))


def _of_wall(wall: Wall, index: int, samples: Floats) -> SiteFinding | None:
    """Return the larger difference of a wall's two sides, if it exceeds the tolerance."""
    half, worst = wall.thickness_m / 2, 0.0
    for place_m in surface_offsets(samples, wall.start, wall.end, half + _REACH_M):
        if place_m is not None and abs(abs(place_m) - half) > abs(worst):
            worst = abs(place_m) - half
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
