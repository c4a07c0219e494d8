"""What the graph says about a robot's topics: who publishes, who listens, with which type and quality of service.

Pure: it is handed endpoints and knows no connection.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from vsnbench.errors import RobotError

OURS = ("vsnbench", "vsnbench_doctor", "discrete_move", "simulated_robot")
"""Names of our own nodes, with a number behind them or without."""
_RELIABLE, _LASTING = "RELIABLE", "TRANSIENT_LOCAL"
_FOR_EVER_NS = 365 * 24 * 3600 * 10**9
"""A duration beyond it is how the middleware says that there is none."""


@dataclass(frozen=True, slots=True)
class Endpoint:
    """One publisher or subscriber of a topic."""

    node: str
    """Full name of its node."""
    type_name: str
    """`nav_msgs/msg/Odometry`."""
    type_hash: str
    """REP-2016's hash of the type's definition; empty from a distribution before Iron."""
    qos: Any
    gid: bytes = b""

    @property
    def qos_words(self) -> str:
        """Its quality of service, in the words of ROS."""
        parts = (self.qos.reliability.name, self.qos.durability.name)
        return ", ".join(part.lower().replace("_", " ") for part in parts)

    @property
    def steers_for_us(self) -> bool:
        """Whether it is a node of ours that commands velocities."""
        name = self.node.rsplit("/", 1)[-1]
        return name in OURS or (name.startswith("vsnbench_") and name.removeprefix("vsnbench_").isdigit())


def listeners(subscribers: Sequence[Endpoint]) -> list[Endpoint]:
    """Return those that move a base by the velocities they hear: all but our own client, doctor and discrete_move."""
    return [one for one in subscribers if not one.steers_for_us or one.node.endswith("/simulated_robot")]


def command_fault(topic: str, wanted: str, subscribers: Sequence[Endpoint], known: Sequence[str]) -> RobotError | None:
    """Return why no base can be steered on a topic, and what to do; None when one can.

    Args:
        topic: of the velocities.
        wanted: the type that the profile names; empty for whichever the base listens to.
        subscribers: all that the graph knows.
        known: the types of velocities.
    """
    bases = listeners(subscribers)
    if not bases:
        return RobotError(
            f"nobody listens to velocities on {topic}",
            advice="start the base's driver, or name its topic in the profile (interface.command); same domain?",
        )
    kinds = sorted({one.type_name for one in bases})
    if wanted and wanted not in kinds:
        return RobotError(
            f"{bases[0].node} listens to {' and '.join(kinds)} on {topic}, the profile says {wanted}",
            advice=f"set interface.command_type to {kinds[0]}",
        )
    if not set(kinds) & set(known):
        return RobotError(
            f"{bases[0].node} listens to {' and '.join(kinds)} on {topic}", advice=f"a velocity is {' or '.join(known)}"
        )
    return None


def type_fault(topic: str, wanted: str, publishers: Sequence[Endpoint]) -> RobotError | None:
    """Return that a topic has another type than it should; None when it has not, or nobody publishes."""
    kinds = sorted({one.type_name for one in publishers})
    if not kinds or wanted in kinds:
        return None
    return RobotError(
        f"{topic} is a {' and '.join(kinds)}, not a {wanted}", advice="name the right topic in the profile"
    )


def hash_fault(topic: str, ours: str, theirs: Sequence[Endpoint]) -> str:
    """Return that a type of the same name is defined otherwise elsewhere; empty when it is not, or nobody says."""
    for one in theirs:
        if ours and one.type_hash and one.type_hash != ours:
            return f"{topic}: {one.node} has another definition of {one.type_name} than this machine"
    return ""


def incompatibility(publisher: Any, listeners: Sequence[Endpoint]) -> RobotError | None:
    """Return the listener that will never hear a publisher, and why; None when all do."""
    for one in listeners:
        asks = one.qos
        unmet = [
            what
            for what, fails in (
                ("reliable", _is(asks.reliability, _RELIABLE) and not _is(publisher.reliability, _RELIABLE)),
                ("transient local", _is(asks.durability, _LASTING) and not _is(publisher.durability, _LASTING)),
                ("a deadline", 0 < asks.deadline.nanoseconds < _FOR_EVER_NS),
                ("a lease of liveliness", 0 < asks.liveliness_lease_duration.nanoseconds < _FOR_EVER_NS),
            )
            if fails
        ]
        if unmet:
            return RobotError(
                f"{one.node} asks for {' and '.join(unmet)} and would never hear what is sent {words(publisher)}",
                advice="set its quality of service to what drivers use, best effort and volatile",
            )
    return None


def words(qos: Any) -> str:
    """Return a quality of service in the words of ROS."""
    reliable = "reliable" if _is(qos.reliability, _RELIABLE) else "best effort"
    return f"{reliable} and {'transient local' if _is(qos.durability, _LASTING) else 'volatile'}"


def _is(policy: Any, name: str) -> bool:
    return bool(policy.name == name)
