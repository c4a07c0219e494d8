"""All that a robot on a network has reported by one moment, as one immutable value."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from vsnbench.errors import SensorLostError
from vsnbench.protocol.pose import Pose
from vsnbench.sensing.discrete_mover import Hazard, Outcome
from vsnbench.sensing.odometry import OdometryFault, OdometryReading
from vsnbench.sensing.pairing import Stamped
from vsnbench.sensing.simulation import SimulationAccount

SOURCE_MEMORY_S = 2.0
"""A node that published on a topic within this time publishes on it."""
AGE_LIMIT_S = 1.0
"""A part whose last message is older does not answer."""


@dataclass(frozen=True, slots=True, eq=False)
class RobotSnapshot:
    """What was heard, consistent within itself; the next message makes another one. Messages are not decoded yet."""

    readings: tuple[OdometryReading, ...] = ()
    """The last odometry readings, oldest first."""
    odometry_fault: OdometryFault | None = None
    """What was wrong with the odometry since the last `RobotLink.clear_events`; None for nothing."""
    colors: tuple[Stamped[Any], ...] = ()
    """The last colour images (sensor_msgs/Image), oldest first; likewise the others."""
    depths: tuple[Stamped[Any], ...] = ()
    labels: tuple[Stamped[Any], ...] = ()
    """A simulator's instance images."""
    categories: Mapping[int, str] = field(default_factory=lambda: MappingProxyType({}))
    """A simulator's categories of the labels."""
    pressed: frozenset[tuple[Hazard, int]] = frozenset()
    """Hazard sensors that are active, by their number."""
    hazard_events: tuple[tuple[Hazard, str], ...] = ()
    """What hazards began, and where, since the last `clear_events`."""
    contact: str = ""
    """What a simulated robot touches, or has touched since the last `clear_events`."""
    truth: Stamped[Pose] | None = None
    """Where a simulated robot stands in its site."""
    simulation: SimulationAccount | None = None
    """What a simulator says of itself."""
    outcome: Outcome | None = None
    """What our own discrete_move reported of the last movement."""
    steered_s: float = -math.inf
    """When somebody else last commanded a velocity (monotonic clock)."""
    driven_s: float = -math.inf
    """When somebody else last commanded a velocity other than zero."""
    driven_by: str = ""
    """The node that did."""
    sources: Mapping[tuple[str, str], float] = field(default_factory=lambda: MappingProxyType({}))
    """When the last message came by (topic, node), monotonic clock; odometry and images only."""

    @property
    def latest(self) -> OdometryReading | None:
        """The newest odometry; None before the first."""
        return self.readings[-1] if self.readings else None

    def odometry_age_s(self, now_s: float) -> float:
        """Return how long ago the newest odometry arrived; infinite before the first."""
        return math.inf if self.latest is None else now_s - self.latest.arrival_s

    def nodes_heard_on(self, topic: str, now_s: float) -> list[str]:
        """Return who has published on a topic lately, sorted."""
        heard = [node for (name, node), at_s in self.sources.items() if name == topic]
        return sorted(node for node in heard if now_s - self.sources[topic, node] < SOURCE_MEMORY_S)

    def rivals(self, topic: str, now_s: float) -> SensorLostError | None:
        """Return that several nodes publish on a topic, and nobody knows whom to believe; None while one does."""
        nodes = self.nodes_heard_on(topic, now_s)
        if len(nodes) < 2:
            return None
        return SensorLostError(f"{' and '.join(nodes)} both publish {topic}", advice="end one of them")

    def at_rest(self, settle_s: float, still_m: float, still_rad: float) -> bool:
        """Return whether the odometry of the last `settle_s`, on the robot's clock, is all one place."""
        if self.latest is None:
            return False
        newest = self.latest
        for reading in reversed(self.readings):
            if reading.pose.distance_to(newest.pose) > still_m:
                return False
            if abs(reading.pose.heading_rad - newest.pose.heading_rad) > still_rad:
                return False
            if newest.stamp_s - reading.stamp_s >= settle_s - 1e-3:
                return True
        return False
