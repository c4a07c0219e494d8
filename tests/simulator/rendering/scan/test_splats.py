"""Splats are drawn from front to back: colours by opacity, depth where half is covered, holes elsewhere."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.simulator.scan.made_scans import splats_of, write_splats
from tests.simulator.scan.rooms import room
from vsnbench.simulator.rendering.renderer import Eye, camera_axes
from vsnbench.simulator.rendering.scan.drawing import ScanDrawer
from vsnbench.simulator.rendering.scan.splats import Splats
from vsnbench.simulator.scan.splat_files import read_spz

VIEW = (np.zeros(3), camera_axes(Eye(0.0, 0.0, 0.0, 0.0)), 200.0, 79.5, 59.5)
"""From the origin along x: 160 x 120 pixels."""
SHAPE = (120, 160)


def sheet(x_m: float, color: tuple[int, int, int], opacity: int) -> Splats:
    """Return splats on a square across the view, 4 cm apart."""
    y, z = (grid.reshape(-1) for grid in np.meshgrid(np.arange(-1, 1, 0.04), np.arange(-1, 1, 0.04)))
    centres = np.column_stack([np.full(len(y), x_m), y, z]).astype(np.float32)
    spreads = np.tile(np.array([1e-6, 0, 0, 9e-4, 0, 9e-4], np.float32), (len(y), 1))
    return Splats(centres, spreads, np.tile(np.array([*color, opacity], np.uint8), (len(y), 1)))


def together(*parts: Splats) -> Splats:
    return Splats(*(np.concatenate([getattr(p, n) for p in parts]) for n in ("centres", "spreads", "paint")))


def looked(splats: Splats) -> tuple[np.ndarray, np.ndarray]:
    rgb, depth = np.empty((*SHAPE, 3), np.uint8), np.empty(SHAPE, np.float32)
    ScanDrawer(replace(room(), splats=splats)).look(VIEW, rgb, depth)
    return rgb, depth


def test_opaque_splats_hide_what_is_behind_them_in_any_order() -> None:
    red, blue = sheet(2.0, (220, 30, 30), 250), sheet(3.0, (30, 30, 220), 250)
    for splats in (together(red, blue), together(blue, red)):
        rgb, depth = looked(splats)
        assert np.abs(rgb.astype(int) - (220, 30, 30)).max() <= 6
        assert np.abs(depth - 2.0).max() < 0.01


def test_depth_is_that_at_which_half_is_covered() -> None:
    _, depth = looked(together(sheet(1.0, (0, 0, 0), 12), sheet(2.0, (90, 90, 90), 250)))
    assert np.abs(depth - 2.0).max() < 0.01
    _, depth = looked(together(sheet(1.0, (0, 0, 0), 120), sheet(2.0, (90, 90, 90), 250)))
    assert np.abs(depth - 1.0).max() < 0.01


def test_what_less_than_half_covers_is_a_hole_with_the_colour_around_it() -> None:
    splats = sheet(2.0, (200, 100, 50), 250)
    rgb, depth = looked(splats.chosen(splats.centres[:, 1] > 0.2))
    assert np.isnan(depth[:, -30:]).all()
    assert np.abs(rgb[:, -30:].astype(int) - (200, 100, 50)).max() <= 6


def test_splats_show_the_depth_of_the_triangles_that_they_were_made_of(tmp_path: Path) -> None:
    mesh = room(table=True, textured=False)
    write_splats(splats_of(mesh, 40), tmp_path / "room.spz")
    splats = read_spz((tmp_path / "room.spz").read_bytes())
    view = (np.array([0.4, 0.5, 1.2]), camera_axes(Eye(0.0, 0.0, 0.0, 0.6, -0.2)), 120.0, 79.5, 59.5)
    expected, measured = (ScanDrawer(scan).measure(view, SHAPE).copy() for scan in (mesh, replace(mesh, splats=splats)))
    assert np.isfinite(measured).mean() > 0.99
    off = np.abs(measured - expected)[np.isfinite(measured) & np.isfinite(expected)]
    assert float(np.percentile(off, 90)) < 0.02
    assert float(np.median(off)) < 0.006


def test_broken_values_end_without_a_picture() -> None:
    splats = sheet(2.0, (200, 100, 50), 250)
    for spread in (0.0, -1.0, 1e6, np.float32(3e38)):
        splats.spreads[:] = spread
        rgb, depth = looked(splats)
        assert rgb.shape == (*SHAPE, 3)
        assert depth.shape == SHAPE
