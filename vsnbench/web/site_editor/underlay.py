"""The underlay of a plan: a robot's map, to scale, or an image of a floor plan, both with proposed walls.

It is saved next to the site file with its place: `lab.underlay.json` and `lab.underlay.png`.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Self

import cv2
import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vsnbench.errors import UsageError
from vsnbench.files.atomic import write_atomic
from vsnbench.interop.ros_map import bytes_of, decoded, grid_of, parse_ros_map, read_ros_map
from vsnbench.settings.validation import first_error
from vsnbench.site_checks.map_walls.corners import WallLine
from vsnbench.site_checks.map_walls.grid import FREE, OCCUPIED, PlanGrid
from vsnbench.site_checks.map_walls.lines import propose_walls
from vsnbench.values.pose import Pose

_INITIAL_WIDTH_M = 10.0
"""Width of an image until the user sets its scale."""
_MAX_WIDTH_PX = 3000
_MAX_LINES = 400
_MAX_COORDINATE_M = 1e4

_Metres = Annotated[float, Field(ge=-_MAX_COORDINATE_M, le=_MAX_COORDINATE_M)]
_Point = tuple[_Metres, _Metres]


class Segment(BaseModel):
    """A line segment, metres in the site's frame."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    start: _Point
    end: _Point


class ProposedWall(Segment):
    """A proposed wall by its centre line, and the openings in it."""

    thickness_m: float = Field(gt=0, le=100)
    doorways: tuple[Segment, ...] = Field(default=(), max_length=50)

    @classmethod
    def of(cls, line: WallLine) -> Self:
        """Return the proposal for a wall found in a grid."""
        openings = tuple(Segment(start=start, end=end) for start, end in line.doorways)
        return cls(start=line.start, end=line.end, thickness_m=round(line.thickness_m, 2), doorways=openings)


class UnderlayPlace(BaseModel):
    """The place of an underlay on the plan, and its open proposals."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: str = Field(max_length=200)
    x_m: _Metres
    """Lower left corner, with `y_m`."""
    y_m: _Metres
    heading_rad: float = Field(ge=-100, le=100)
    """Rotation about that corner."""
    width_m: float = Field(gt=0, le=_MAX_COORDINATE_M)
    height_m: float = Field(gt=0, le=_MAX_COORDINATE_M)
    to_scale: bool
    lines: tuple[ProposedWall, ...] = Field(default=(), max_length=_MAX_LINES)


@dataclass(frozen=True, slots=True)
class Underlay:
    """An image with its place on the plan."""

    png: bytes
    place: UnderlayPlace

    @classmethod
    def of(cls, image: bytes, map_yaml: str | None, name: str) -> "Underlay":
        """Return the underlay of an uploaded image.

        Args:
            image: the encoded image.
            map_yaml: text of the map.yaml, for a ROS map.
            name: file name, for messages.

        Raises:
            UsageError: a file cannot be read.
        """
        if map_yaml is not None:
            return cls.of_grid(grid_of(parse_ros_map(map_yaml, name or "map.yaml"), image, name or "the map"), name)
        pixels = decoded(image, name or "the image")
        columns = pixels.shape[1]
        if columns > _MAX_WIDTH_PX:
            scale = _MAX_WIDTH_PX / columns
            pixels = np.asarray(cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
        grey = pixels if pixels.ndim == 2 else cv2.cvtColor(np.ascontiguousarray(pixels[..., :3]), cv2.COLOR_BGR2GRAY)
        _, dark = cv2.threshold(grey, 0, 1, cv2.THRESH_BINARY_INV + cv2.THRESH_OTSU)
        cells = np.where(np.flipud(dark) > 0, OCCUPIED, FREE).astype(np.uint8)
        grid = PlanGrid(np.ascontiguousarray(cells), _INITIAL_WIDTH_M / cells.shape[1], Pose(0.0, 0.0))
        return cls(_png(pixels), _place_of(grid, name, propose_walls(grid, 0.8), to_scale=False))

    @classmethod
    def of_grid(cls, grid: PlanGrid, name: str) -> "Underlay":
        """Return the underlay of a map.

        Raises:
            UsageError: `empty-map`, no cell is occupied.
        """
        if not (grid.cells == OCCUPIED).any():
            raise UsageError(
                f"the map {name} has no occupied cell",
                advice="check mode and negate in its YAML file",
                code="empty-map",
            )
        return cls(_png(grid.picture()), _place_of(grid, name, propose_walls(grid), to_scale=True))

    @classmethod
    def of_file(cls, path: Path) -> "Underlay":
        """Return the underlay of a file: a map.yaml or an image.

        Raises:
            UsageError: the file cannot be read.
        """
        if path.suffix in (".yaml", ".yml"):
            return cls.of_grid(read_ros_map(path), path.name)
        return cls.of(bytes_of(path), None, path.name)

    @classmethod
    def load(cls, site: Path) -> "Underlay | None":
        """Return the saved underlay of a site file, or None.

        Raises:
            UsageError: `invalid-underlay`, it cannot be read.
        """
        place_file, image_file = _files_of(site)
        if not place_file.exists():
            return None
        try:
            place = UnderlayPlace.model_validate_json(bytes_of(place_file))
            image = bytes_of(image_file)
            decoded(image, str(image_file))
        except (ValidationError, UsageError) as error:
            problem = error if isinstance(error, UsageError) else f"{place_file} is not a valid place of an underlay"
            raise UsageError(
                str(problem), advice=f"remove {place_file} to start without an underlay", code="invalid-underlay"
            ) from error
        return cls(image, place)

    def save(self, site: Path) -> None:
        """Write the image and its place next to a site file.

        Raises:
            UsageError: the files cannot be written.
        """
        place_file, image_file = _files_of(site)
        write_atomic(image_file, self.png, UsageError)
        write_atomic(place_file, self.place.model_dump_json(indent=1).encode(), UsageError)

    @staticmethod
    def delete(site: Path) -> None:
        """Delete the saved underlay of a site file, if there is one.

        Raises:
            UsageError: a file cannot be deleted.
        """
        for path in _files_of(site):
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                raise UsageError(f"cannot remove {path}: {error.strerror or error}") from error

    def at_place(self, place: dict[str, Any]) -> "Underlay":
        """Return the same image at another place.

        Raises:
            UsageError: the place is invalid.
        """
        try:
            return replace(self, place=UnderlayPlace.model_validate(place))
        except ValidationError as error:
            field, problem = first_error(error, UnderlayPlace)
            raise UsageError(f"the underlay's {field}: {problem.statement}", advice=problem.advice) from error

    def content(self) -> dict[str, Any]:
        """Return the place and the proposals as JSON."""
        return self.place.model_dump(mode="json")


def _place_of(grid: PlanGrid, name: str, lines: list[WallLine], *, to_scale: bool) -> UnderlayPlace:
    width_m, height_m = grid.size_m
    return UnderlayPlace(
        name=name,
        x_m=grid.origin.x_m,
        y_m=grid.origin.y_m,
        heading_rad=grid.origin.heading_rad,
        width_m=width_m,
        height_m=height_m,
        to_scale=to_scale,
        lines=tuple(ProposedWall.of(line) for line in lines[:_MAX_LINES]),
    )


def _files_of(site: Path) -> tuple[Path, Path]:
    return site.with_suffix(".underlay.json"), site.with_suffix(".underlay.png")


def _png(pixels: "np.typing.NDArray[np.uint8]") -> bytes:
    _, encoded = cv2.imencode(".png", pixels)
    return bytes(encoded)
