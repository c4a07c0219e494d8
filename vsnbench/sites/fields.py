"""Field types and the base class of the models of a site file."""

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from shapely.geometry import Polygon
from shapely.validation import explain_validity

from vsnbench.sites.length_unit import check_coordinate

Coordinate = Annotated[float, AfterValidator(check_coordinate)]
Point = tuple[Coordinate, Coordinate]
Heading = Annotated[float, Field(ge=-3600, le=3600)]
"""Degrees, at most ten turns: far larger numbers overflow on the way to their sine."""
Color = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]
Slug = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", max_length=80)]
"""Name of a goal, in lower case without spaces."""

_SMALLEST_M2 = 1e-6


class StrictModel(BaseModel):
    """A frozen model without unknown fields and without infinite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy without cached properties, which belong to the values before `update`."""
        copy = super().model_copy(update=update, deep=deep)
        for name in set(copy.__dict__) - set(type(self).model_fields):
            del copy.__dict__[name]
        return copy


def check_outline(outline: list[Point] | None) -> list[Point] | None:
    """Return an outline if it encloses an area.

    Raises:
        ValueError: it crosses itself, or encloses no area.
    """
    if outline is not None:
        shape = Polygon(outline)
        if not shape.is_valid:
            raise ValueError(
                f"the outline crosses itself: list its corners in order around the outline ({explain_validity(shape)})"
            )
        if shape.area < _SMALLEST_M2:
            raise ValueError("the outline encloses no area")
    return outline
