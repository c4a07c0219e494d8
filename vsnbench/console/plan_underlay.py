"""What is laid under a plan that is drawn: a robot's map to scale with walls proposed, or a picture to be scaled.

Saving a site keeps it beside the site's file, with its place: `lab.underlay.json` and `lab.underlay.png`.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vsnbench.errors import UsageError
from vsnbench.exchange.ros_map import bytes_of, decoded, grid_of, parse_ros_map, read_ros_map
from vsnbench.protocol.pose import Pose
from vsnbench.sensing.plan_grid import FREE, OCCUPIED, PlanGrid
from vsnbench.sensing.wall_corners import WallLine
from vsnbench.sensing.wall_lines import propose_walls
from vsnbench.whole_files import write_whole

_PICTURE_M = 10.0
"""So wide a picture is taken to be until two of its points are given their distance."""
_MOST_PIXELS_WIDE = 3000
_MOST_LINES = 400
_FARTHEST_M = 1e4

_Metres = Annotated[float, Field(ge=-_FARTHEST_M, le=_FARTHEST_M)]
_Point = tuple[_Metres, _Metres]


class Stretch(BaseModel):
    """A piece of a line by its two ends, metres in the site's frame."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    start: _Point
    end: _Point


class ProposedWall(Stretch):
    """A proposed wall by the ends of its centre line, and the clear openings on it."""

    thickness_m: float = Field(gt=0, le=100)
    doorways: tuple[Stretch, ...] = Field(default=(), max_length=50)

    @classmethod
    def of(cls, line: WallLine) -> Self:
        """Return a wall that was found in a grid."""
        openings = tuple(Stretch(start=start, end=end) for start, end in line.doorways)
        return cls(start=line.start, end=line.end, thickness_m=round(line.thickness_m, 2), doorways=openings)


class UnderlayPlace(BaseModel):
    """Where an underlay lies on the plan, and what is still proposed in it."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: str = Field(max_length=200)
    x_m: _Metres
    """Of its lower left corner, likewise `y_m`."""
    y_m: _Metres
    heading_rad: float = Field(ge=-100, le=100)
    """How it is turned about that corner."""
    width_m: float = Field(gt=0, le=_FARTHEST_M)
    height_m: float = Field(gt=0, le=_FARTHEST_M)
    to_scale: bool
    lines: tuple[ProposedWall, ...] = Field(default=(), max_length=_MOST_LINES)


@dataclass(frozen=True, slots=True)
class Underlay:
    """A picture with its place on the plan."""

    png: bytes
    place: UnderlayPlace

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
        columns = pixels.shape[1]
        if columns > _MOST_PIXELS_WIDE:
            scale = _MOST_PIXELS_WIDE / columns
            pixels = np.asarray(cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
        grey = pixels if pixels.ndim == 2 else cv2.cvtColor(np.ascontiguousarray(pixels[..., :3]), cv2.COLOR_BGR2GRAY)
        _, dark = cv2.threshold(grey, 0, 1, cv2.THRESH_BINARY_INV + cv2.THRESH_OTSU)
        cells = np.where(np.flipud(dark) > 0, OCCUPIED, FREE).astype(np.uint8)
        grid = PlanGrid(np.ascontiguousarray(cells), _PICTURE_M / cells.shape[1], Pose(0.0, 0.0))
        return cls(_png(pixels), _placed(grid, name, propose_walls(grid, 0.8), to_scale=False))

    @classmethod
    def of_grid(cls, grid: PlanGrid, name: str) -> "Underlay":
        """Return a map, with walls proposed.

        Raises:
            UsageError: nothing in it is occupied.
        """
        if not (grid.cells == OCCUPIED).any():
            raise UsageError(
                f"nothing in the map {name} is occupied",
                advice="look at mode and negate in its YAML file",
            )
        return cls(_png(grid.picture()), _placed(grid, name, propose_walls(grid), to_scale=True))

    @classmethod
    def of_file(cls, path: Path) -> "Underlay":
        """Return the underlay of a file: a map by its map.yaml, or a picture.

        Raises:
            UsageError: it cannot be read.
        """
        if path.suffix in (".yaml", ".yml"):
            return cls.of_grid(read_ros_map(path), path.name)
        return cls.of(bytes_of(path), None, path.name)

    @classmethod
    def kept(cls, site: Path) -> "Underlay | None":
        """Return what lies beside a site's file since it was saved; None where nothing does.

        Raises:
            UsageError: it cannot be read any more; says what to remove.
        """
        described, picture = _beside(site)
        if not described.exists():
            return None
        try:
            place = UnderlayPlace.model_validate_json(bytes_of(described))
            image = bytes_of(picture)
            decoded(image, str(picture))
        except (ValidationError, UsageError) as error:
            problem = error if isinstance(error, UsageError) else f"{described} does not say where the underlay lies"
            raise UsageError(f"{problem}", advice=f"remove {described} to begin without an underlay") from error
        return cls(image, place)

    def keep(self, site: Path) -> None:
        """Write the picture and its place beside a site's file.

        Raises:
            UsageError: they cannot be written.
        """
        described, picture = _beside(site)
        write_whole(picture, self.png, UsageError)
        write_whole(described, self.place.model_dump_json(indent=1).encode(), UsageError)

    @staticmethod
    def forget(site: Path) -> None:
        """Remove what lies beside a site's file, where something does.

        Raises:
            UsageError: it cannot be removed.
        """
        for path in _beside(site):
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                raise UsageError(f"cannot remove {path}: {error.strerror or error}") from error

    def placed(self, said: dict[str, Any]) -> "Underlay":
        """Return the same picture at the place that the page says.

        Raises:
            UsageError: it is no place.
        """
        try:
            return replace(self, place=UnderlayPlace.model_validate(said))
        except ValidationError as error:
            first = error.errors()[0]
            raise UsageError(f"the underlay's {'.'.join(map(str, first['loc']))}: {first['msg']}") from error

    def content(self) -> dict[str, Any]:
        """Return where it lies and what it proposes, for the page."""
        return self.place.model_dump(mode="json")


def _placed(grid: PlanGrid, name: str, lines: list[WallLine], *, to_scale: bool) -> UnderlayPlace:
    width_m, height_m = grid.size_m
    return UnderlayPlace(
        name=name,
        x_m=grid.origin.x_m,
        y_m=grid.origin.y_m,
        heading_rad=grid.origin.heading_rad,
        width_m=width_m,
        height_m=height_m,
        to_scale=to_scale,
        lines=tuple(ProposedWall.of(line) for line in lines[:_MOST_LINES]),
    )


def _beside(site: Path) -> tuple[Path, Path]:
    return site.with_suffix(".underlay.json"), site.with_suffix(".underlay.png")


def _png(pixels: "np.typing.NDArray[np.uint8]") -> bytes:
    import cv2

    _, encoded = cv2.imencode(".png", pixels)
    return bytes(encoded)
