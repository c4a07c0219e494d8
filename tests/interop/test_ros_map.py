"""ROS maps in the format of map_server."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from vsnbench.errors import UsageError
from vsnbench.interop.ros_map import read_ros_map, write_ros_map
from vsnbench.interop.site_map import map_of_site
from vsnbench.site_checks.map_walls.grid import FREE, OCCUPIED, UNKNOWN, PlanGrid
from vsnbench.sites.site import load_site
from vsnbench.values.pose import Pose

GREY = np.array([[0, 254, 205], [254, 0, 254]], np.uint8)
"""The highest row first: occupied, free, unknown over free, occupied, free."""
CELLS = [[FREE, OCCUPIED, FREE], [OCCUPIED, FREE, UNKNOWN]]


def a_map(folder: Path, image: np.ndarray, *lines: str, name: str = "map.png") -> Path:
    cv2.imwrite(str(folder / name), image)
    path = folder / "map.yaml"
    path.write_text("\n".join([f"image: {name}", "resolution: 0.1", "origin: [1, 2, 0]", *lines]), encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["map.png", "map.pgm"])
def test_a_trinary_map_is_read_from_the_lowest_row_up(tmp_path: Path, name: str) -> None:
    grid = read_ros_map(a_map(tmp_path, GREY, "negate: 0", name=name))
    assert grid.cells.tolist() == CELLS
    assert (grid.resolution_m, grid.origin.position) == (0.1, (1.0, 2.0))


def test_a_negated_map_has_light_walls(tmp_path: Path) -> None:
    assert read_ros_map(a_map(tmp_path, 255 - GREY, "negate: 1")).cells.tolist() == CELLS


def test_in_scale_mode_what_is_transparent_is_unknown(tmp_path: Path) -> None:
    shown = np.dstack([GREY, GREY, GREY, np.full_like(GREY, 255)])
    shown[0, 1, 3] = 0
    cells = read_ros_map(a_map(tmp_path, shown, "mode: scale")).cells.tolist()
    assert cells == [[FREE, OCCUPIED, FREE], [OCCUPIED, UNKNOWN, UNKNOWN]]


def test_a_turned_origin_turns_the_points(tmp_path: Path) -> None:
    path = a_map(tmp_path, GREY)
    path.write_text(path.read_text(encoding="utf-8").replace("[1, 2, 0]", f"[1, 2, {math.pi / 2}]"), encoding="utf-8")
    (point,) = read_ros_map(path).in_site(np.array([[10.0, 0.0]])).tolist()
    assert point == pytest.approx([1.0, 3.0])


def test_a_sites_map_comes_back_from_its_files(tmp_path: Path) -> None:
    grid = map_of_site(load_site("apartment"))
    write_ros_map(grid, tmp_path / "map.yaml")
    back = read_ros_map(tmp_path / "map.yaml")
    assert np.array_equal(back.cells, grid.cells)
    assert back.origin.position == pytest.approx(grid.origin.position)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("image: none.png\nresolution: 0.05\n", "cannot read .*none.png"),
        ("image: map.yaml\nresolution: 0.05\n", "not a readable image"),
        ("image: map.png\n", "resolution: required field is missing"),
        ("image: map.png\nresolution: 0\n", "resolution"),
    ],
)
def test_what_is_no_map_is_refused_in_a_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "map.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError, match=words):
        read_ros_map(path)


def test_a_grid_of_nothing_is_a_map_too(tmp_path: Path) -> None:
    write_ros_map(PlanGrid(np.zeros((2, 3), np.uint8), 0.05, Pose(0.0, 0.0)), tmp_path / "map.yaml")
    assert read_ros_map(tmp_path / "map.yaml").cells.tolist() == [[UNKNOWN] * 3] * 2
