"""The table of placements: where a robot stood at the start of an episode, as it was measured when a person said go."""

from datetime import datetime

from sqlalchemy import ForeignKey
from sqlalchemy.orm import Mapped, mapped_column

from vsnbench.database.column_types import JsonValue
from vsnbench.database.tables import Base


class Placement(Base):
    """A measured placement that was accepted; none where the robot could not be measured, or nobody looked."""

    __tablename__ = "placement"

    id: Mapped[int] = mapped_column(primary_key=True)
    episode_id: Mapped[int] = mapped_column(ForeignKey("episode.id"), unique=True)
    created_at: Mapped[datetime]
    author: Mapped[str]
    """Who said go with it; empty where nobody did."""
    method: Mapped[str]
    """A value of `vsnbench.protocol.placement.PlacementMethod`: one look, or a turn on the spot."""
    looks: Mapped[int]
    """Depth images that it was measured from."""
    x_m: Mapped[float]
    y_m: Mapped[float]
    heading_rad: Mapped[float]
    """Where it stood, in the site's frame."""
    covariance: Mapped[list[float]] = mapped_column(JsonValue)
    """xx, xy, xh, yy, yh, hh in the site's frame: m², m·rad, rad²."""
    ahead_m: Mapped[float]
    left_m: Mapped[float]
    turn_rad: Mapped[float]
    """Where it stood as seen from the mark: ahead of it, to its left, turned counter-clockwise."""
    determined: Mapped[bool]
    """The measured pose was taken for the start of the trajectory."""
    within_tolerance: Mapped[bool]
    """The whole 95 % region lay within the protocol's tolerance: green."""
    undetermined: Mapped[list[str]]
    """Directions that the view did not determine."""
    moved: Mapped[list[str]]
    """Ids of the site's objects that did not stand where the survey says."""
    depth_scale: Mapped[float]
    """What the depth camera's metres had to be multiplied with."""
    words: Mapped[str]
    """What the person was told."""
