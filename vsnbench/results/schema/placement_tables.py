"""Table of measured poses."""

from datetime import datetime

from sqlalchemy import ForeignKey, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from vsnbench.results.schema.base import JsonValue, TableBase


class Placement(TableBase):
    """A measured pose of the robot at its mark or where it stopped; absent if the pose was not measured."""

    __tablename__ = "placement"
    __table_args__ = (UniqueConstraint("episode_id", "moment"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    episode_id: Mapped[int] = mapped_column(ForeignKey("episode.id"))
    moment: Mapped[str]
    """`start`: at the mark, as accepted; `stop`: after STOP."""
    created_at: Mapped[datetime]
    author: Mapped[str]
    """Operator who accepted the placement, or an empty string."""
    method: Mapped[str]
    """Value of `vsnbench.values.placement.PlacementMethod`: one look, a turn on the spot, or the last steps."""
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
    """Offset from the mark, or from the pose by the odometry: ahead, left, counter-clockwise turn."""
    determined: Mapped[bool]
    """The measured pose was used: as the start of the trajectory, or as the pose that the protocol judged."""
    within_tolerance: Mapped[bool]
    """At the mark: the whole 95 % region was within the protocol's tolerance."""
    undetermined: Mapped[list[str]]
    """Directions that the view did not determine."""
    moved: Mapped[list[str]]
    """Ids of the site's objects that were not at their surveyed position."""
    depth_scale: Mapped[float]
    """Scale factor of the depth camera."""
    words: Mapped[str]
    """Text shown to the operator."""
    distance_m: Mapped[float | None]
    """After STOP: distance to the goal from the measured pose; NULL if it is not determined."""
    distance_low_m: Mapped[float | None]
    distance_high_m: Mapped[float | None]
    """Least and greatest distance from the measured pose's 95 % region; NULL if it is not bounded."""
    odometry_m: Mapped[float | None]
    """After STOP: distance to the goal from the pose by the odometry."""
    odometry_low_m: Mapped[float | None]
    odometry_high_m: Mapped[float | None]
    """Least and greatest distance from the 95 % region of the pose by the odometry."""
    verdicts_differ: Mapped[bool | None]
    """After STOP: it succeeds by one of the two poses and fails by the other."""
