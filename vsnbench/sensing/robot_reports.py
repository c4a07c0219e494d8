"""The latest reports of a robot as one immutable snapshot; each report replaces the snapshot."""

import json
import logging
import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, TypeVar

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.errors import RobotError, SensorLostError
from vsnbench.sensing.hazards import Hazard
from vsnbench.sensing.images.camera_images import Stamped
from vsnbench.sensing.images.intrinsics import Calibration, CalibrationError, Intrinsics
from vsnbench.sensing.odometry.odometry import OdometryFault, OdometryReading, OdometryTracker
from vsnbench.sensing.simulation import read_account
from vsnbench.text.sanitize import error_line
from vsnbench.values.battery import Battery
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.pose import Attitude, Pose
from vsnbench.values.robot_identity import SimulationAccount
from vsnbench.values.robot_profile import RobotProfile

logger = logging.getLogger(__name__)

Found = TypeVar("Found")


SOURCE_MEMORY_S = 2.0
"""A node counts as publisher of a topic for this long after its last message."""
AGE_LIMIT_S = 1.0
"""Age of the last message from which a part does not answer."""
_ATTITUDE_PERIOD_S = 0.009
"""Shortest time between two attitudes that are kept; an IMU may send a thousand a second."""
_ATTITUDES = 300
"""Number of attitudes that are kept: those of 3 s, longer than a median of depth images takes."""


@dataclass(frozen=True, slots=True, eq=False)
class RobotSnapshot:
    """The state of a robot after one message; images are not decoded."""

    readings: tuple[OdometryReading, ...] = ()
    """Latest odometry readings, oldest first."""
    odometry_fault: OdometryFault | None = None
    """Latest fault of the odometry since `RobotReports.clear_events`, or None."""
    attitudes: tuple[Stamped[Attitude], ...] = ()
    """Latest attitudes of the base, oldest first; empty for a profile without their source."""
    attitude_fault: str = ""
    """Why the last message of that source gave none, or empty."""
    colors: tuple[Stamped[Any], ...] = ()
    """Latest colour images (sensor_msgs/Image), oldest first, as are depths and labels."""
    depths: tuple[Stamped[Any], ...] = ()
    labels: tuple[Stamped[Any], ...] = ()
    """Instance images of a simulator."""
    further: Mapping[str, tuple[Stamped[Any], ...]] = field(default_factory=lambda: MappingProxyType({}))
    """Latest images of further cameras by topic, oldest first."""
    received: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    """Number of messages so far, by the field that they fill: `readings`, `colors`, `depths`, `labels`."""
    calibrations: Mapping[str, Calibration] = field(default_factory=lambda: MappingProxyType({}))
    """Calibration by topic of the images; None for an uncalibrated camera_info."""
    categories: Mapping[int, str] | None = None
    """Categories of a simulator by label; None before the first message, and empty for a site without objects."""
    active_hazards: frozenset[tuple[Hazard, int]] = frozenset()
    """Active hazard sensors: hazard and number of the sensor."""
    hazard_events: tuple[tuple[Hazard, str], ...] = ()
    """Hazards that became active since `clear_events`, and their positions."""
    contact: str = ""
    """Object that a simulated robot has touched since `clear_events`, or empty."""
    truth: Stamped[Pose] | None = None
    """Pose of a simulated robot in its site."""
    simulation: SimulationAccount | None = None
    """Description of the simulator."""
    outcome: MotionResult | None = None
    """What a discrete_move of vsnbench reports of the last movement."""
    steered_s: float = -math.inf
    """Time of the last velocity of another node (monotonic clock)."""
    commanded: Command = STANDSTILL
    """That velocity."""
    driven_s: float = -math.inf
    """Time of the last non-zero velocity of another node."""
    driven_by: str = ""
    """Node that sent it."""
    rival_s: float = -math.inf
    """Time of the last non-zero velocity of a node outside this session."""
    rival: str = ""
    """Node that sent it."""
    battery: Battery | None = None
    """Latest battery report."""
    sources: Mapping[tuple[str, str], float] = field(default_factory=lambda: MappingProxyType({}))
    """Time of the last message by (topic, node), monotonic clock; odometry and images only."""

    @property
    def latest(self) -> OdometryReading | None:
        """Newest odometry; None before the first."""
        return self.readings[-1] if self.readings else None

    def odometry_age_s(self, now_s: float) -> float:
        """Return the age of the newest odometry; infinite before the first."""
        return math.inf if self.latest is None else now_s - self.latest.arrival_s

    def publishers(self, topic: str, now_s: float) -> list[str]:
        """Return the recent publishers of a topic, sorted."""
        return sorted(
            node for (name, node), at_s in self.sources.items() if name == topic and now_s - at_s < SOURCE_MEMORY_S
        )

    def rivals(self, topic: str, now_s: float) -> SensorLostError | None:
        """Return the fault of a topic with several publishers, or None."""
        nodes = self.publishers(topic, now_s)
        if len(nodes) < 2:
            return None
        return SensorLostError(
            f"{' and '.join(nodes)} both publish {topic}", advice="end one of them", code="two-publishers"
        )

    def at_rest(self, settle_s: float, still_m: float, still_rad: float) -> bool:
        """Return whether the odometry has not changed for `settle_s` on the robot's clock."""
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
    """Collects the reports of a robot from the threads of a middleware."""

    def __init__(self, profile: RobotProfile) -> None:
        self._changed = threading.Condition()
        self._snapshot = RobotSnapshot()
        self._tracker = OdometryTracker(profile.base.max_linear_m_s, profile.base.max_angular_rad_s)
        self._max_readings = max(10, round(2 * profile.base.odometry_rate_hz))

    def snapshot(self) -> RobotSnapshot:
        """Return the current snapshot."""
        return self._snapshot

    def wait_for(self, condition: Callable[[RobotSnapshot], Found], timeout_s: float) -> Found:
        """Evaluate `condition` on the current snapshot and each new one until its result is true.

        Returns:
            The last result; false after the timeout.
        """
        with self._changed:
            return self._changed.wait_for(lambda: condition(self._snapshot), timeout_s)

    def clear_events(self) -> None:
        """Drop the events so far; active hazard sensors stay active."""
        self._update(lambda _: {"hazard_events": (), "odometry_fault": None, "contact": ""})

    def take_odometry(self, pose: tuple[float, float, float], stamp_s: float, topic: str, source: str) -> None:
        """Take the odometry: x and y in metres, heading in radians."""
        arrival_s = time.monotonic()

        def changes(now: RobotSnapshot) -> dict[str, Any]:
            heard = {"sources": _sources(now, topic, source), "received": _counted(now, "readings")}
            fault = self._tracker.add(*pose, stamp_s, arrival_s)
            if fault is not None:
                return heard | {"odometry_fault": fault}
            return heard | {"readings": (*now.readings, self._tracker.latest)[-self._max_readings :]}

        self._update(changes)

    def take_attitude(self, measured: Attitude | str, stamp_s: float) -> None:
        """Take an attitude, or the reason why a message of its source gives none; stamps on the robot's clock.

        Of more than 100 a second, only some are kept.
        """
        if isinstance(measured, str):
            self._update(lambda _: {"attitude_fault": measured, "attitudes": ()})
            return
        known = self._snapshot.attitudes
        if known and 0 <= stamp_s - known[-1].stamp_s < _ATTITUDE_PERIOD_S:
            return
        if known and stamp_s < known[-1].stamp_s:  # the clock was set back
            known = ()
        taken = (*known, Stamped(measured, stamp_s, time.monotonic()))[-_ATTITUDES:]
        self._update(lambda _: {"attitude_fault": "", "attitudes": taken})

    def take_image(self, field: str, capacity: int, message: Any, stamp_s: float, topic: str, source: str) -> None:
        """Take an undecoded image.

        Args:
            field: field of the snapshot: `colors`, `depths`, `labels` or `further`.
            capacity: number of images that the snapshot holds.
            message: the image.
            stamp_s: stamp on the clock of the sender.
            topic: topic of the image.
            source: node that sent it.
        """
        image = Stamped(message, stamp_s, time.monotonic())

        def taken(now: RobotSnapshot) -> Any:
            if field != "further":
                return (*getattr(now, field), image)[-capacity:]
            return MappingProxyType({**now.further, topic: (*now.further.get(topic, ()), image)[-capacity:]})

        self._update(
            lambda now: {
                field: taken(now),
                "sources": _sources(now, topic, source),
                "received": _counted(now, field),
            }
        )

    def take_camera_info(self, image_topic: str, info: Any) -> None:
        """Take the sensor_msgs/CameraInfo of the images of a topic."""
        calibration: Calibration
        try:
            calibration = Intrinsics.of(info, image_topic)
        except CalibrationError as error:
            calibration = error
        known = self._snapshot.calibrations
        if image_topic not in known or str(known[image_topic]) != str(calibration):
            calibrations = MappingProxyType({**known, image_topic: calibration})
            self._update(lambda _: {"calibrations": calibrations})

    def take_command(self, source: str, command: Command, *, rival: bool) -> None:
        """Take a velocity of another node.

        Args:
            source: the node.
            command: the velocity.
            rival: whether the node does not execute movements of this session.
        """
        now_s = time.monotonic()
        moves = command != STANDSTILL
        driven = {"driven_s": now_s, "driven_by": source} if moves else {}
        rivalled = {"rival_s": now_s, "rival": source} if moves and rival else {}
        self._update(lambda _: {"steered_s": now_s, "commanded": command, **driven, **rivalled})

    def take_own_command(self) -> None:
        """Take that this process commanded a velocity."""
        now_s = time.monotonic()
        self._update(lambda _: {"steered_s": now_s})

    def take_hazard(self, hazard: Hazard, sensor: int, active: bool, where: str) -> None:
        """Take the state of one sensor."""
        if active:
            self._update(
                lambda now: {
                    "active_hazards": now.active_hazards | {(hazard, sensor)},
                    "hazard_events": (*now.hazard_events, (hazard, where)),
                }
            )
        else:
            self._update(lambda now: {"active_hazards": now.active_hazards - {(hazard, sensor)}})

    def take_battery(self, battery: Battery | None) -> None:
        """Take a battery report; None is ignored."""
        if battery is not None and battery != self._snapshot.battery:
            self._update(lambda _: {"battery": battery})

    def take_contact(self, touched: str) -> None:
        """Take the object that a simulated robot touches, or an empty string."""
        if touched:
            self._update(lambda _: {"contact": touched})

    def take_truth(self, pose: tuple[float, float, float], stamp_s: float) -> None:
        """Take the pose of a simulated robot: metres and radians."""
        truth = Stamped(Pose(*pose), stamp_s, time.monotonic())
        self._update(lambda _: {"truth": truth})

    def take_categories(self, text: str) -> None:
        """Take the categories of a simulator's labels as JSON; errors are logged."""
        try:
            named = {int(number): str(name) for number, name in json.loads(text).items()}
        except (ValueError, AttributeError, RecursionError) as error:
            logger.warning("the categories of a simulator are invalid: %s", error_line(error))
            return
        self._update(lambda _: {"categories": MappingProxyType(named)})

    def take_account(self, text: str) -> None:
        """Take the description of a simulator as JSON; errors are logged."""
        try:
            account = read_account(text)
        except RobotError as error:
            logger.warning("%s", error)
            return
        self._update(lambda _: {"simulation": account})

    def take_outcome(self, outcome: MotionResult | None) -> None:
        """Take the outcome of a movement; None clears it."""
        self._update(lambda _: {"outcome": outcome})

    def _update(self, changes: Callable[[RobotSnapshot], dict[str, Any]]) -> None:
        """Apply `changes(snapshot)` to the snapshot, and wake waiting threads."""
        with self._changed:
            self._snapshot = replace(self._snapshot, **changes(self._snapshot))
            self._changed.notify_all()


def _counted(now: RobotSnapshot, field: str) -> Mapping[str, int]:
    return MappingProxyType({**now.received, field: now.received.get(field, 0) + 1})


def _sources(now: RobotSnapshot, topic: str, source: str) -> MappingProxyType[tuple[str, str], float]:
    """Return the recent publishers, including a known sender of the present message."""
    if not source:
        return MappingProxyType(dict(now.sources))
    at_s = time.monotonic()
    recent = {key: last_s for key, last_s in now.sources.items() if at_s - last_s < SOURCE_MEMORY_S}
    return MappingProxyType(recent | {(topic, source): at_s})
