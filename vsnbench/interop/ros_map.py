"""Reads and writes ROS maps: `map.yaml` with a PGM, PNG, BMP or JPEG, as in map_server."""

import math
import re
import struct
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from vsnbench.errors import UsageError
from vsnbench.files.atomic import write_atomic
from vsnbench.files.regular import open_regular
from vsnbench.settings.yaml_file import parse_settings
from vsnbench.site_checks.map_walls.grid import FREE, OCCUPIED, UNKNOWN, PlanGrid
from vsnbench.values.encoding.images import picture_size
from vsnbench.values.pose import Pose

LARGEST_PIXELS = 40_000_000
LARGEST_BYTES = 64 * 1024 * 1024
_ROWS_AT_ONCE = 256
"""Rows that are converted together: floating-point copies of a whole image would take gigabytes."""
_BLANK = rb"(?:\s|#[^\n]*\n)+"
_NETPBM = re.compile(rb"P[1-6]" + _BLANK + rb"(\d{1,9})" + _BLANK + rb"(\d{1,9})\s")


class RosMap(BaseModel):
    """Fields of a `map.yaml`."""

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)

    image: str = ""
    resolution: float = Field(gt=1e-4, lt=10)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    negate: Literal[0, 1] = 0
    occupied_thresh: float = Field(default=0.65, ge=0, le=1)
    free_thresh: float = Field(default=0.196, ge=0, le=1)
    mode: Literal["trinary", "scale", "raw"] = "trinary"


def read_ros_map(path: Path) -> PlanGrid:
    """Read a map from its YAML file and the image next to it.

    Raises:
        UsageError: a file cannot be read or is invalid.
    """
    described = parse_ros_map(bytes_of(path).decode("utf-8", "replace"), str(path))
    image = path.parent / described.image
    return grid_of(described, bytes_of(image), str(image))


def parse_ros_map(text: str, origin: str) -> RosMap:
    """Read the text of a `map.yaml`.

    Raises:
        UsageError: the text is invalid.
    """
    return parse_settings(text, origin, RosMap, UsageError, "map")


def grid_of(described: RosMap, image: bytes, origin: str) -> PlanGrid:
    """Return the grid of a map from its description and image.

    Raises:
        UsageError: the image cannot be read.
    """
    pixels = decoded(image, origin)
    cells = np.empty(pixels.shape[:2], np.uint8)
    for top in range(0, len(cells), _ROWS_AT_ONCE):
        rows = slice(top, top + _ROWS_AT_ONCE)
        cells[rows] = _cells_of(described, pixels[rows])
    x_m, y_m, yaw_rad = described.origin
    return PlanGrid(np.ascontiguousarray(np.flipud(cells)), described.resolution, Pose(x_m, y_m, yaw_rad))


def _cells_of(described: RosMap, pixels: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    colours = pixels[..., :3] if pixels.ndim == 3 else pixels[..., None]
    grey = colours.astype(np.float64).mean(axis=2)
    occupied = grey / 255 if described.negate else (255 - grey) / 255
    if described.mode == "raw":
        occupied = np.where(grey <= 100, grey / 100, 0.5)
    cells = np.full(grey.shape, UNKNOWN, np.uint8)
    cells[occupied > described.occupied_thresh] = OCCUPIED
    cells[occupied < described.free_thresh] = FREE
    if described.mode == "raw":
        cells[grey > 100] = UNKNOWN
    if pixels.ndim == 3 and pixels.shape[2] == 4 and described.mode == "scale":
        cells[pixels[..., 3] < 255] = UNKNOWN
    return cells


def decoded(image: bytes, origin: str) -> npt.NDArray[np.uint8]:
    """Return an image's pixels, (H, W) or (H, W, 3 or 4), top row first.

    The size in the header is checked before decoding, because a small file can have billions of pixels.

    Raises:
        UsageError: the image cannot be read or is too large.
    """
    import cv2

    size = picture_size(image) or _plain_size(image)
    if size is not None and size[0] * size[1] > LARGEST_PIXELS:
        raise UsageError(
            f"{origin} has {size[0]} x {size[1]} pixels; the limit is {LARGEST_PIXELS:,} in total",
            advice="crop the map, or save it with larger cells",
            code="too-many-pixels",
        )
    pixels: Any = None
    if size is not None:
        with suppress(cv2.error):
            pixels = cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None or pixels.size == 0 or pixels.dtype not in (np.uint8, np.uint16):
        raise UsageError(
            f"{origin} is not a readable image", advice="use PGM, PNG, BMP or JPEG", code="unreadable-image"
        )
    if pixels.dtype == np.uint16:
        np.floor_divide(pixels, 257, out=pixels)  # 65535 becomes 255
    return np.asarray(pixels, np.uint8)


def _plain_size(image: bytes) -> tuple[int, int] | None:
    """Return width and height in pixels from the header of a PGM, PPM, PBM or BMP; None for other content."""
    if (match := _NETPBM.match(image)) is not None:
        return int(match[1]), int(match[2])
    if not image.startswith(b"BM") or len(image) < 26:
        return None
    if int.from_bytes(image[14:18], "little") == 12:
        return int.from_bytes(image[18:20], "little"), int.from_bytes(image[20:22], "little")
    width, height = struct.unpack_from("<ii", image, 18)
    return abs(width), abs(height)  # a negative height means that the top row is first


def write_ros_map(grid: PlanGrid, path: Path) -> tuple[Path, Path]:
    """Write `path` (map.yaml) and the PGM next to it, and return both paths.

    Raises:
        UsageError: they cannot be written.
    """
    image = path.with_suffix(".pgm")
    picture = grid.picture()
    rows, columns = picture.shape
    write_atomic(image, f"P5\n{columns} {rows}\n255\n".encode() + picture.tobytes(), UsageError)
    x_m, y_m, yaw_rad = grid.origin.x_m, grid.origin.y_m, math.remainder(grid.origin.heading_rad, math.tau)
    text = (
        f"image: {image.name}\nmode: trinary\nresolution: {grid.resolution_m:.6g}\n"
        f"origin: [{x_m:.6f}, {y_m:.6f}, {yaw_rad:.6f}]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    write_atomic(path, text.encode(), UsageError)
    return path, image


def bytes_of(path: Path) -> bytes:
    """Read a file of limited size.

    Raises:
        UsageError: the file cannot be read or is too large.
    """
    try:
        with open_regular(path) as file:
            content = file.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror or error}") from error
    if len(content) > LARGEST_BYTES:
        raise UsageError(
            f"{path} has more than {LARGEST_BYTES // 2**20} MiB", advice="crop the map, or save it with larger cells"
        )
    return content
