"""Scan against survey: what a scan shows of a wall is compared, and what it does not show is not."""

from pathlib import Path

import numpy as np
import pytest

from tests.simulator.scan.rooms import of_quads
from vsnbench.simulator.scan.comparison import scan_findings
from vsnbench.sites.scan import SiteScan
from vsnbench.sites.site import Room, Site, StartingPosition, Wall

WIDE_M, DEEP_M, HIGH_M = 4.0, 3.0, 2.5
CORNERS = [(0.0, 0.0), (WIDE_M, 0.0), (WIDE_M, DEEP_M), (0.0, DEEP_M)]


def upright(start: tuple[float, float], end: tuple[float, float], low: float = 0.0, high: float = HIGH_M) -> np.ndarray:
    """Return an upright surface that faces to the left of the way from start to end."""
    return np.array([(*start, high), (*end, high), (*end, low), (*start, low)])


def inside(shift_m: float = 0.0) -> list[np.ndarray]:
    """Return the walls of a room as seen from inside; the southern one moved outwards."""
    corners = [(x, y - shift_m * (y == 0)) for x, y in CORNERS]
    floor = np.array([(*corner, 0.0) for corner in corners])
    return [floor, *(upright(corners[k], corners[(k + 1) % 4]) for k in range(4))]


def surveyed(folder: Path, quads: list[np.ndarray], half: float = 0.05, walls: tuple[Wall, ...] = ()) -> Site:
    sha256 = of_quads(np.array(quads), textured=False).write(folder / "lab.scan.npz")
    around = [(-half, -half), (WIDE_M + half, -half), (WIDE_M + half, DEEP_M + half), (-half, DEEP_M + half)]
    outer = [Wall(start=around[k], end=around[(k + 1) % 4], thickness_m=2 * half) for k in range(4)]
    return Site(
        name="lab",
        rooms=[Room(name="room", polygon=CORNERS)],
        walls=[*outer, *walls],
        starts=[StartingPosition(number=1, position=(1, 1), heading_deg=0)],
        scan=SiteScan.model_validate({"file": "lab.scan.npz", "sha256": sha256}, context={"directory": folder}),
    )


def found(site: Site, folder: Path) -> list[tuple[str, float]]:
    assert site.scan is not None
    object.__setattr__(site.scan, "path", folder / "lab.scan.npz")
    return [(each.subject, round(each.amount or 0, 2)) for each in scan_findings(site) if each.code == "scan-wall"]


@pytest.mark.parametrize("half", [0.01, 0.05, 0.1, 0.2])
def test_walls_that_were_seen_from_inside_only_are_in_order(half: float, tmp_path: Path) -> None:
    assert found(surveyed(tmp_path, inside(), half), tmp_path) == []


def test_a_wall_that_stands_elsewhere_is_named_by_the_side_that_was_seen(tmp_path: Path) -> None:
    assert found(surveyed(tmp_path, inside(shift_m=0.09)), tmp_path) == [("wall 1", pytest.approx(0.09, abs=0.011))]
    assert found(surveyed(tmp_path, inside(shift_m=0.03)), tmp_path) == []


def test_what_leans_on_a_wall_or_stands_behind_it_is_no_part_of_it(tmp_path: Path) -> None:
    shelf = upright((0.5, 0.2), (3.0, 0.2), 0.8, 1.8)
    back = upright((3.0, 0.2), (0.5, 0.2), 0.3, 0.8)
    assert found(surveyed(tmp_path, [*inside(), back]), tmp_path) == []
    behind = upright((4.0, -0.3), (0.0, -0.3))  # the next room's side of another wall
    assert found(surveyed(tmp_path, [*inside(), shelf]), tmp_path) == []
    other = Wall(start=(0, -0.25), end=(4, -0.25), thickness_m=0.1)
    assert found(surveyed(tmp_path, [*inside(), behind], walls=(other,)), tmp_path) == []


def test_a_wall_is_compared_on_both_sides_that_were_seen(tmp_path: Path) -> None:
    between = (upright((2.05, 3), (2.05, 0)), upright((1.95, 0), (1.95, 3)))
    inner = Wall(start=(2, 0), end=(2, 3), thickness_m=0.1)
    assert found(surveyed(tmp_path, [*inside(), *between], walls=(inner,)), tmp_path) == []
    thin = inner.model_copy(update={"thickness_m": 0.02, "start": (1.95, 0.0), "end": (1.95, 3.0)})
    site = surveyed(tmp_path, [*inside(), *between], walls=(thin,))
    assert found(site, tmp_path) == [("wall 5", pytest.approx(0.09, abs=0.011))]
