"""Before an episode over ROS: every part answers, the robot stands at its start, its odometry is fresh.

All of it, but for the person's time, shares one patience: parts that come up late, or come back, are waited for.
"""

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from vsnbench.errors import NotPlacedError, RobotError, SensorLostError
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import StartingPosition
from vsnbench.ros1.graph_check import GraphFault, graph_faults, unknown_to_master
from vsnbench.ros1.master import MasterError, SystemState
from vsnbench.ros1.robot_snapshot import RobotSnapshot
from vsnbench.ros1.service_call import ServiceError

if TYPE_CHECKING:
    from vsnbench.ros1.robot_link import RobotLink

logger = logging.getLogger(__name__)

_AGE_LIMIT_S = 1.0
"""A part whose last message is older does not answer."""
_RETRY_S = 0.25
_CONNECTING_S = 1.0
"""Parts that answer take this long to connect, of which nothing need be said."""


@dataclass
class Patience:
    """How long the parts of a robot may still take to answer; says once what is waited for."""

    allowed_s: float
    _give_up_s: float = field(init=False)
    _said: str = field(init=False, default="")

    def __post_init__(self) -> None:
        self._give_up_s = time.monotonic() + self.allowed_s

    @property
    def left_s(self) -> float:
        """Seconds that are left; not less than one period of trying again."""
        return max(self._give_up_s - time.monotonic(), _RETRY_S)

    def wait(self, missing: RobotError) -> None:
        """Pause before another try.

        Raises:
            RobotError: there is no patience left.
        """
        if time.monotonic() >= self._give_up_s:
            raise RobotError(f"{missing.statement} (waited {self.allowed_s:.0f} s)", advice=missing.advice) from missing
        if (said := str(missing)) != self._said and self.allowed_s - self.left_s > _CONNECTING_S:
            logger.warning("waiting: %s", said)
            self._said = said
        time.sleep(_RETRY_S)

    def insist_on(self, step: Callable[[], None]) -> None:
        """Do `step`, again and again while a part of the robot does not answer.

        Raises:
            RobotError: there is no patience left, or it fails for another reason.
        """
        while True:
            try:
                return step()
            except (ServiceError, MasterError, SensorLostError) as error:
                self.wait(error)


def wait_until_ready(link: "RobotLink", profile: RobotProfile, patience: Patience) -> None:
    """Wait until every part of the robot answers; say what is waited for.

    Raises:
        RobotError: a part does not answer within the patience, or never will; the message says what to start.
    """
    warned: set[str] = set()
    while (missing := _missing_part(link, profile, warned)) is not None:
        patience.wait(missing)


def have_it_placed_by_the_simulator(link: "RobotLink", start: StartingPosition, seed: int, patience: Patience) -> None:
    """Have the simulator put the robot at `start`.

    Raises:
        RobotError: it cannot stand there, or the simulator does not answer.
    """

    def is_there(now: RobotSnapshot) -> bool:
        return now.truth is not None and now.truth.payload.distance_to(start.pose) < 0.02

    def place() -> None:
        if problem := link.place(start.pose, seed, patience.left_s):
            raise RobotError(f"the robot cannot stand at starting position {start.number}: {problem}")
        _wait(link, is_there, 2.0, "the simulator's ground truth")

    patience.insist_on(place)


def require_it_stands(link: "RobotLink") -> None:
    """See that the robot stands on its wheels and nothing is pressed.

    Raises:
        NotPlacedError: it does not.
    """
    if pressed := sorted({hazard.value for hazard, _ in link.snapshot().pressed}):
        raise NotPlacedError(f"the base still reports: {', '.join(pressed)}")


def await_fresh_odometry(link: "RobotLink", patience: Patience) -> None:
    """Wait for a reading from after now, to call it the start of the episode.

    Raises:
        RobotError: no odometry comes.
    """
    asked_s = time.monotonic()

    def fresh(now: RobotSnapshot) -> bool:
        return now.latest is not None and now.latest.arrival_s > asked_s

    patience.insist_on(lambda: _wait(link, fresh, 2.0, f"odometry on {link.names.odometry}"))


def _missing_part(link: "RobotLink", profile: RobotProfile, warned: set[str]) -> RobotError | None:
    """Return the first part that does not answer and what to do about it; None when all do.

    Raises:
        RobotError: the master was restarted, which no patience heals.
    """
    names, now, now_s = link.names, link.snapshot(), time.monotonic()
    try:
        state, types = link.master.state(), link.master.topic_types()
    except MasterError as error:
        return error
    if link.master.caller not in state.subscribers.get(names.odometry, []):
        raise RobotError(
            f"the master at {link.master.uri} was restarted and knows nothing of this session",
            advice="restart all nodes (driver, camera, discrete_move), then the same command goes on",
        )
    for fault in graph_faults(names, state, types, frozenset({link.master.caller})):
        if fault.fatal:
            return fault.error
        if (said := str(fault.error)) not in warned:
            warned.add(said)
            logger.warning("%s", said)
    if now_s - now.driven_s < _AGE_LIMIT_S:
        return RobotError(f"{now.driven_by} is driving the base", advice="end it, or wait until it has")
    if now.odometry_age_s(now_s) > _AGE_LIMIT_S:
        return _silence("odometry", names.odometry, state, "the base's driver")
    for topic, images in ((names.color, now.colors), (names.depth, now.depths)):
        if topic and (not images or now_s - images[-1].arrival_s > _AGE_LIMIT_S):
            return _silence("image", topic, state, "the camera's driver")
    if (unknown := _unknown_node(link, now, state)) is not None:
        return unknown.error
    try:
        link.discrete_move.probe()
    except RobotError as error:
        start = f"(vsnbench ros discrete-move --robot {profile.name})"
        return RobotError(error.statement, advice=f"{error.advice} {start}".strip())
    return None


def _unknown_node(link: "RobotLink", now: RobotSnapshot, state: SystemState) -> GraphFault | None:
    now_s = time.monotonic()
    topics = [topic for topic in (link.names.odometry, link.names.color, link.names.depth) if topic]
    faults = (unknown_to_master(topic, now.nodes_heard_on(topic, now_s), state) for topic in topics)
    return next((fault for fault in faults if fault is not None), None)


def _silence(what: str, topic: str, state: SystemState, driver: str) -> RobotError:
    """Say why nothing comes on a topic, as far as the master knows."""
    if publishers := state.publishers.get(topic):
        nodes = " and ".join(publishers)
        return RobotError(
            f"no {what} on {topic}, which {nodes} publishes", advice="is it alive, and are ROS_IP and cables right?"
        )
    return RobotError(
        f"no {what} on {topic}",
        advice=f"start {driver}; if it runs, the master was restarted after it: restart all nodes",
    )


def _wait(link: "RobotLink", condition: Callable[[RobotSnapshot], bool], timeout_s: float, what: str) -> None:
    if not link.wait_for(condition, timeout_s):
        raise SensorLostError(f"waited {timeout_s:g} s in vain for {what}")
