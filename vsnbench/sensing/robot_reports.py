"""All that a robot on a network has reported by one moment, as one immutable value, and where it is kept.

Each report makes a new RobotSnapshot, and nothing else is shared.
"""

import json
import logging
import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, TypeVar

from vsnbench.errors import RobotError, SensorLostError
from vsnbench.harmless_text import error_line
from vsnbench.protocol.battery import Battery
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_identity import SimulationAccount
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.sensing.camera_images import Stamped
from vsnbench.sensing.discrete_mover import Hazard, Outcome
from vsnbench.sensing.odometry import OdometryFault, OdometryReading, OdometryTracker
from vsnbench.sensing.simulation import read_account

logger = logging.getLogger(__name__)

Found = TypeVar("Found")


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
    battery: Battery | None = None
    """What the base last said of its battery."""
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


class RobotReports:
    """Takes reports from threads of a middleware and shows them, consistent within themselves, to whoever asks."""

    def __init__(self, profile: RobotProfile) -> None:
        self._changed = threading.Condition()
        self._snapshot = RobotSnapshot()
        self._tracker = OdometryTracker(profile.base.max_linear_m_s, profile.base.max_angular_rad_s)
        self._most_readings = max(10, round(2 * profile.base.odometry_rate_hz))

    def snapshot(self) -> RobotSnapshot:
        """Return what has been reported until now."""
        return self._snapshot

    def wait_for(self, condition: Callable[[RobotSnapshot], Found], timeout_s: float) -> Found:
        """Ask `condition` of the present snapshot and of every new one until it answers with something true.

        Returns:
            Its last answer: the first true one, or a false one when none came in time.
        """
        with self._changed:
            return self._changed.wait_for(lambda: condition(self._snapshot), timeout_s)

    def clear_events(self) -> None:
        """Forget what has happened; what is pressed stays known."""
        self._update(lambda _: {"hazard_events": (), "odometry_fault": None, "contact": ""})

    def take_odometry(self, pose: tuple[float, float, float], stamp_s: float, topic: str, source: str) -> None:
        """Take a measurement of the base: x and y in metres, heading in radians."""
        arrival_s = time.monotonic()

        def changes(now: RobotSnapshot) -> dict[str, Any]:
            sources = _heard(now, topic, source)
            fault = self._tracker.add(*pose, stamp_s, arrival_s)
            if fault is not None:
                return {"sources": sources, "odometry_fault": fault}
            return {"sources": sources, "readings": (*now.readings, self._tracker.latest)[-self._most_readings :]}

        self._update(changes)

    def take_image(self, kept: str, most: int, message: Any, stamp_s: float, topic: str, source: str) -> None:
        """Take an image that is not decoded yet.

        Args:
            kept: the field of the snapshot: `colors`, `depths` or `labels`.
            most: how many of them are kept.
            message: the image.
            stamp_s: when it was taken, on the sender's clock.
            topic: what it came on.
            source: the node that sent it.
        """
        image = Stamped(message, stamp_s, time.monotonic())
        self._update(lambda now: {kept: (*getattr(now, kept), image)[-most:], "sources": _heard(now, topic, source)})

    def take_command(self, source: str, *, moves: bool) -> None:
        """Take a velocity that somebody else commanded."""
        now_s = time.monotonic()
        self._update(lambda _: {"steered_s": now_s, **({"driven_s": now_s, "driven_by": source} if moves else {})})

    def take_own_command(self) -> None:
        """This process steers the base itself."""
        now_s = time.monotonic()
        self._update(lambda _: {"steered_s": now_s})

    def take_hazard(self, hazard: Hazard, sensor: int, active: bool, where: str) -> None:
        """Take one sensor's change of state."""
        if active:
            self._update(
                lambda now: {
                    "pressed": now.pressed | {(hazard, sensor)},
                    "hazard_events": (*now.hazard_events, (hazard, where)),
                }
            )
        else:
            self._update(lambda now: {"pressed": now.pressed - {(hazard, sensor)}})

    def take_battery(self, battery: Battery | None) -> None:
        """Take what the base says of its battery; None says nothing."""
        if battery is not None and battery != self._snapshot.battery:
            self._update(lambda _: {"battery": battery})

    def take_contact(self, touched: str) -> None:
        """Take what a simulated robot touches; empty for nothing."""
        if touched:
            self._update(lambda _: {"contact": touched})

    def take_truth(self, pose: tuple[float, float, float], stamp_s: float) -> None:
        """Take where a simulated robot stands."""
        truth = Stamped(Pose(*pose), stamp_s, time.monotonic())
        self._update(lambda _: {"truth": truth})

    def take_categories(self, text: str) -> None:
        """Take a simulator's categories of its labels, as JSON; what cannot be read is logged."""
        try:
            named = {int(number): str(name) for number, name in json.loads(text).items()}
        except (ValueError, AttributeError, RecursionError) as error:
            logger.warning("a simulator's categories cannot be read: %s", error_line(error))
            return
        self._update(lambda _: {"categories": MappingProxyType(named)})

    def take_account(self, text: str) -> None:
        """Take what a simulator says of itself, as JSON; what cannot be read is logged."""
        try:
            account = read_account(text)
        except RobotError as error:
            logger.warning("%s", error)
            return
        self._update(lambda _: {"simulation": account})

    def take_outcome(self, outcome: Outcome | None) -> None:
        """Take what became of a movement; None before the next one."""
        self._update(lambda _: {"outcome": outcome})

    def _update(self, changes: Callable[[RobotSnapshot], dict[str, Any]]) -> None:
        """Replace the snapshot by one with `changes(present one)`, and wake who waits."""
        with self._changed:
            self._snapshot = replace(self._snapshot, **changes(self._snapshot))
            self._changed.notify_all()


def _heard(now: RobotSnapshot, topic: str, source: str) -> MappingProxyType[tuple[str, str], float]:
    """Return who has published lately, this message included where its sender is known."""
    if not source:
        return MappingProxyType(dict(now.sources))
    at_s = time.monotonic()
    lately = {key: heard_s for key, heard_s in now.sources.items() if at_s - heard_s < SOURCE_MEMORY_S}
    return MappingProxyType(lately | {(topic, source): at_s})
