"""Checks before an episode that every part of a robot answers."""

import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from vsnbench.errors import RobotError
from vsnbench.ros.common.hazard_topics import WRONG_TYPE
from vsnbench.ros.common.interface import RosInterface
from vsnbench.sensing.odometry.transform_chain import TF_ADVICE
from vsnbench.sensing.robot_reports import AGE_LIMIT_S, RobotSnapshot
from vsnbench.values.robot_profile import RobotProfile

logger = logging.getLogger(__name__)


@dataclass
class Readiness(ABC):
    """Finds the first part of a robot that does not answer."""

    names: RosInterface
    """Interface of the robot's profile."""
    snapshot: Callable[[], RobotSnapshot]
    """Returns the newest reports of the robot."""
    odometry_fault: Callable[[], str]
    """Returns why TF gives no odometry, or an empty string."""
    profile: RobotProfile
    others_drive: bool = field(init=False, default=False)
    """Whether a stack drives the robot, whose commands are expected."""
    _warned: set[str] = field(init=False, default_factory=set)
    _deaf_topics: set[str] = field(init=False, default_factory=set)
    """Topics of hazard sensors about which the session was warned."""

    def missing_part(self, warned: set[str]) -> RobotError | None:
        """Return the first part that does not answer, with advice; None when all parts answer.

        Args:
            warned: warnings that were logged already; new ones are logged and added.

        Raises:
            RobotError: waiting does not help.
        """
        self._warned = warned
        time.sleep(self._discovery_left_s)
        now, now_s = self.snapshot(), time.monotonic()
        return (
            self._network_fault()
            or self._sensor_fault(now, now_s)
            or self._server_fault(now)
            or self._hazard_fault(now)
        )

    @property
    def _discovery_left_s(self) -> float:
        """Time until all nodes on the network are known."""
        return 0.0

    @abstractmethod
    def _network_fault(self) -> RobotError | None:
        """Return what is wrong with the nodes on the network and the connection to the base."""

    @abstractmethod
    def _server_fault(self, now: RobotSnapshot) -> RobotError | None:
        """Return what is wrong with the parts that depend on the sensors, the mover included."""

    @abstractmethod
    def _publishers(self, topic: str) -> list[str]:
        """Return the nodes that publish a topic."""

    @abstractmethod
    def _types(self, topic: str) -> Collection[str]:
        """Return the types of the publishers of a topic; empty if no node publishes it."""

    @abstractmethod
    def _silence(self, what: str, topic: str, driver: str) -> RobotError:
        """Return why no messages arrive on a topic."""

    def _hazard_fault(self, now: RobotSnapshot) -> RobotError | None:
        """Return the fault of a hazard topic with which no episode may begin; log others once per session.

        A simulator reports contacts on its own topic.
        """
        if now.simulation is not None:
            return None
        for part in self.names.hazard_topics:
            fault = part.fault(self._types(part.topic))
            if fault is not None and fault.code == WRONG_TYPE:
                return fault
            if fault is not None and part.topic not in self._deaf_topics:
                self._deaf_topics.add(part.topic)
                logger.warning("%s", fault)
        return None

    def _warn_once(self, text: str) -> None:
        """Log a warning unless it was logged already."""
        if text not in self._warned:
            self._warned.add(text)
            logger.warning("%s", text)

    def _sensor_fault(self, now: RobotSnapshot, now_s: float) -> RobotError | None:
        names = self.names
        if now_s - now.driven_s < AGE_LIMIT_S:
            return RobotError(
                f"{now.driven_by} is driving the base",
                advice="end that node, or wait until it stops driving",
                code="base-is-driven",
            )
        if names.tf and (rivals := now.rivals(names.odometry_topic, now_s)):
            return rivals
        if now.odometry_age_s(now_s) > AGE_LIMIT_S:
            if names.tf and self._publishers(names.odometry_topic) and (fault := self.odometry_fault()):
                return RobotError(fault, advice=TF_ADVICE, code="no-tf-odometry")
            return self._silence("odometry", names.odometry_topic, "the driver of the base")
        if names.attitude is not None:
            if now.attitude_fault:
                raise RobotError(now.attitude_fault, code="no-attitude")
            if not now.attitudes or now_s - now.attitudes[-1].arrival_s > AGE_LIMIT_S:
                return self._silence("attitude", names.attitude.topic, "the driver of the IMU")
        further = ((topic, now.further.get(topic, ())) for topic in names.further_images)
        for topic, images in ((names.color, now.colors), (names.depth, now.depths), *further):
            if topic and (not images or now_s - images[-1].arrival_s > AGE_LIMIT_S):
                return self._silence("image", topic, "the driver of the camera")
        return None
