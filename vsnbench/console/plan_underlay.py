"""What is laid under a plan that is drawn: a robot's map to scale with walls proposed, or a picture to be scaled."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vsnbench.exchange.ros_map import decoded, grid_of, parse_ros_map, read_ros_map
from vsnbench.protocol.pose import Pose
from vsnbench.sensing.plan_grid import FREE, OCCUPIED, PlanGrid
from vsnbench.sensing.wall_lines import WallLine, propose_walls

_PICTURE_M = 10.0
"""So wide a picture is taken to be until two of its points are given their distance."""
_MOST_PIXELS_WIDE = 3000


@dataclass(frozen=True, slots=True)
class Underlay:
    """A picture with its place on the plan."""

    name: str
    png: bytes
    origin: Pose
    """Its lower left corner, and how it is turned there."""
    width_m: float
    height_m: float
    to_scale: bool
    lines: tuple[WallLine, ...] = ()

    @classmethod
    def of(cls, image: bytes, described: str | None, name: str) -> "Underlay":
        """Return a map, where `described` is the text of its map.yaml, or a picture of a plan.

        Raises:
            UsageError: one of them cannot be read.
        """
        import cv2

        if described is not None:
            return cls.of_grid(grid_of(parse_ros_map(described, name or "map.yaml"), image, name or "the map"), name)
        pixels = decoded(image, name or "the picture")
        rows, columns = pixels.shape[:2]
        if columns > _MOST_PIXELS_WIDE:
            scale = _MOST_PIXELS_WIDE / columns
            pixels = np.asarray(cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
        height_m = _PICTURE_M * rows / columns
        grey = pixels if pixels.ndim == 2 else cv2.cvtColor(np.ascontiguousarray(pixels[..., :3]), cv2.COLOR_BGR2GRAY)
        _, dark = cv2.threshold(grey, 0, 1, cv2.THRESH_BINARY_INV + cv2.THRESH_OTSU)
        cells = np.where(np.flipud(dark) > 0, OCCUPIED, FREE).astype(np.uint8)
        grid = PlanGrid(np.ascontiguousarray(cells), _PICTURE_M / cells.shape[1], Pose(0.0, 0.0))
        return cls(name, _png(pixels), grid.origin, _PICTURE_M, height_m, False, tuple(propose_walls(grid, 0.8))[:400])

    @classmethod
    def of_grid(cls, grid: PlanGrid, name: str) -> "Underlay":
        """Return a map, with walls proposed."""
        width_m, height_m = grid.size_m
        lines = tuple(propose_walls(grid))[:400]
        return cls(name, _png(grid.picture()), grid.origin, width_m, height_m, True, lines)

    @classmethod
    def of_file(cls, path: Path) -> "Underlay":
        """Return the underlay of a file: a map by its map.yaml, or a picture.

        Raises:
            UsageError: it cannot be read.
        """
        from vsnbench.errors import UsageError

        if path.suffix in (".yaml", ".yml"):
            return cls.of_grid(read_ros_map(path), path.name)
        try:
            return cls.of(path.read_bytes(), None, path.name)
        except OSError as error:
            raise UsageError(f"cannot read {path}: {error.strerror or error}") from error

    def content(self) -> dict[str, Any]:
        """Return where it lies and what it proposes, for the page."""
        return {
            "name": self.name,
            "x_m": self.origin.x_m,
            "y_m": self.origin.y_m,
            "heading_rad": self.origin.heading_rad,
            "width_m": self.width_m,
            "height_m": self.height_m,
            "to_scale": self.to_scale,
            "lines": [
                {
                    "start": list(line.start),
                    "end": list(line.end),
                    "thickness_m": round(line.thickness_m, 2),
                    "doorways": [{"start": list(start), "end": list(end)} for start, end in line.doorways],
                }
                for line in self.lines
            ],
        }


def _png(pixels: "np.typing.NDArray[np.uint8]") -> bytes:
    import cv2

    _, encoded = cv2.imencode(".png", pixels)
    return bytes(encoded)
