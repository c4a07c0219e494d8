"""Table of measured start poses."""

from datetime import datetime

from sqlalchemy import ForeignKey
from sqlalchemy.orm import Mapped, mapped_column

from vsnbench.results.schema.base import JsonValue, TableBase


class Placement(TableBase):
    """An accepted measured placement; absent if the pose was not measured."""

    __tablename__ = "placement"

    id: Mapped[int] = mapped_column(primary_key=True)
    episode_id: Mapped[int] = mapped_column(ForeignKey("episode.id"), unique=True)
    created_at: Mapped[datetime]
    author: Mapped[str]
    """Operator who accepted it, or an empty string."""
    method: Mapped[str]
    """Value of `vsnbench.values.placement.PlacementMethod`: one look, or a turn on the spot."""
    looks: Mapped[int]
    """Number of depth images used."""
    x_m: Mapped[float]
    y_m: Mapped[float]
    heading_rad: Mapped[float]
    """Measured pose in the site's frame."""
    covariance: Mapped[list[float]] = mapped_column(JsonValue)
    """Covariance xx, xy, xh, yy, yh, hh in the site's frame: m², m·rad, rad²."""
    ahead_m: Mapped[float]
    left_m: Mapped[float]
    turn_rad: Mapped[float]
    """Offset from the mark: ahead, left, counter-clockwise turn."""
    determined: Mapped[bool]
    """The measured pose was used as the start of the trajectory."""
    within_tolerance: Mapped[bool]
    """The whole 95 % region was within the protocol's tolerance."""
    undetermined: Mapped[list[str]]
    """Directions that the view did not determine."""
    moved: Mapped[list[str]]
    """Ids of the site's objects that were not at their surveyed position."""
    depth_scale: Mapped[float]
    """Scale factor of the depth camera."""
    words: Mapped[str]
    """Text shown to the operator."""
