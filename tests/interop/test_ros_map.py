"""ROS maps in the format of map_server."""

import math
import os
import struct
import subprocess
import sys
import zlib
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


def test_a_grid_of_nothing_is_a_map_too(tmp_path: Path) -> None:
    write_ros_map(PlanGrid(np.zeros((2, 3), np.uint8), 0.05, Pose(0.0, 0.0)), tmp_path / "map.yaml")
    assert read_ros_map(tmp_path / "map.yaml").cells.tolist() == [[UNKNOWN] * 3] * 2


def chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png_bomb(side: int) -> bytes:
    """Return a small PNG of `side` x `side` transparent pixels."""
    compressor, row = zlib.compressobj(9), bytes(1 + 4 * side)
    pixels = b"".join(compressor.compress(row) for _ in range(side)) + compressor.flush()
    header = struct.pack(">IIBBBBB", side, side, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")


READ = """
import sys
from pathlib import Path
from vsnbench.errors import UsageError
from vsnbench.interop.ros_map import read_ros_map
try:
    print(read_ros_map(Path(sys.argv[1])).cells.shape)
except UsageError as error:
    print(error.code)
# ru_maxrss would begin with the memory of the process that started this one.
print(next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM")) // 1024)
"""


def read_in_a_process(path: Path) -> tuple[str, int]:
    """Return what reading a map gives, and the largest memory of the process in MiB."""
    done = subprocess.run([sys.executable, "-c", READ, str(path)], stdout=subprocess.PIPE, text=True, timeout=100)
    result, memory_mib = done.stdout.splitlines()
    return result, int(memory_mib)


def described(folder: Path, name: str, content: bytes) -> Path:
    (folder / name).write_bytes(content)
    path = folder / "map.yaml"
    path.write_text(f"image: {name}\nresolution: 0.1\n", encoding="utf-8")
    return path


def test_the_size_of_an_image_is_checked_before_it_is_decoded(tmp_path: Path) -> None:
    result, memory_mib = read_in_a_process(described(tmp_path, "bomb.png", png_bomb(12_000)))
    assert result == "too-many-pixels"
    assert memory_mib < 300


@pytest.mark.parametrize(
    "content",
    [
        b"P5\n# a comment\n100000 100000\n255\n",
        b"P6 7000 # a comment\n 7000 255\n",
        b"BM" + bytes(12) + struct.pack("<iii", 40, 7000, -7000) + bytes(30),
    ],
)
def test_a_huge_image_is_refused_by_its_header(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(UsageError) as refused:
        read_ros_map(described(tmp_path, "map.img", content))
    assert refused.value.code == "too-many-pixels"


def test_a_large_image_of_16_bits_is_read_with_little_memory(tmp_path: Path) -> None:
    path = a_map(tmp_path, np.full((5000, 8000), 65535, np.uint16))
    result, memory_mib = read_in_a_process(path)
    assert result == "(5000, 8000)"
    assert memory_mib < 700


@pytest.mark.parametrize("name", ["map.pgm", "map.png"])
def test_16_bits_are_read_as_8(tmp_path: Path, name: str) -> None:
    grey = GREY.astype(np.uint16) * 257
    assert read_ros_map(a_map(tmp_path, grey, name=name)).cells.tolist() == CELLS


def test_a_bitmap_is_read(tmp_path: Path) -> None:
    assert read_ros_map(a_map(tmp_path, GREY, name="map.bmp")).cells.tolist() == CELLS


@pytest.mark.parametrize("name", ["map.tiff", "map.pfm"])
def test_an_image_of_floating_point_numbers_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError) as refused:
        read_ros_map(a_map(tmp_path, np.ones((4, 4), np.float32), name=name))
    assert refused.value.code == "unreadable-image"


def test_a_pipe_in_the_place_of_an_image_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "map.pipe")
    path = tmp_path / "map.yaml"
    path.write_text("image: map.pipe\nresolution: 0.1\n", encoding="utf-8")
    with pytest.raises(UsageError, match="not a regular file"):
        read_ros_map(path)
