"""A base is commanded in the type to which it subscribes, and commands of others are distinguished."""

from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from tests.ros.ros2.wire import STAMPED, TWIST, base, qos
from vsnbench.control.command import STANDSTILL, Command
from vsnbench.robots.profiles import load_profile
from vsnbench.ros.ros2.graph import Endpoint
from vsnbench.ros.ros2.interface import Ros2Interface, ros2_interface
from vsnbench.ros.ros2.velocities import Velocities

NAMES = ros2_interface(load_profile("turtlebot4"))


@dataclass
class Publisher:
    kind: str
    sent: list[Command] = field(default_factory=list)
    is_connected: bool = True
    closed: bool = False

    def publish(self, command: Command) -> None:
        assert not self.closed
        self.sent.append(command)

    def close(self) -> None:
        self.closed = True


@dataclass
class Wire:
    """A node and its graph for Velocities."""

    bases: list[Endpoint]
    full_name: str = "/vsnbench_17"
    velocity_quality: Any = field(default_factory=lambda: qos(reliability="RELIABLE"))
    publishers: list[Publisher] = field(default_factory=list)
    connected: bool = True
    takers: list[Callable[[Callable[[], Any], Any], None]] = field(default_factory=list)

    def subscribers(self, topic: str) -> list[Endpoint]:
        assert topic == "/cmd_vel"
        return self.bases

    def sender(self, _topic: str, info: str) -> str:
        return info

    def velocity_publisher(self, topic: str, kind: str) -> Publisher:
        self.publishers.append(Publisher(kind, is_connected=self.connected))
        return self.publishers[-1]

    def subscribe_velocities(self, topic: str, kind: str, take: Callable[[Callable[[], Any], Any], None]) -> None:
        self.takers.append(take)


def velocities(wire: Wire, names: Ros2Interface = NAMES, take: Any = lambda *_: None) -> Velocities:
    return Velocities(wire, wire, names, take)  # type: ignore[arg-type]


def test_commands_are_sent_after_a_base_subscribes_and_in_its_type() -> None:
    wire = Wire([])
    mine = velocities(wire)
    mine.send(STANDSTILL)
    assert mine.connect().code == "no-base"
    assert wire.publishers == []
    wire.bases = [base(kind=STAMPED)]
    assert mine.connect() is None
    mine.send(Command(0.1, 0.2))
    assert [(publisher.kind, publisher.sent) for publisher in wire.publishers] == [(STAMPED, [Command(0.1, 0.2)])]


def test_a_base_that_returns_with_the_other_type_is_commanded_in_it() -> None:
    wire = Wire([base(kind=STAMPED)])
    mine = velocities(wire)
    assert mine.connect() is None
    assert mine.connect() is None
    wire.bases = [base(kind=TWIST)]
    assert mine.connect() is None
    assert [(publisher.kind, publisher.closed) for publisher in wire.publishers] == [(STAMPED, True), (TWIST, False)]


def test_the_profile_decides_for_a_base_that_subscribes_to_both_types() -> None:
    wire = Wire([base(kind=TWIST), base(kind=STAMPED)])
    assert velocities(wire, NAMES.model_copy(update={"command_type": STAMPED})).connect() is None
    assert wire.publishers[0].kind == STAMPED


def test_an_incompatible_or_unconnected_base_is_named() -> None:
    lasting = Wire([base(durability="TRANSIENT_LOCAL")])
    assert velocities(lasting).connect().code == "incompatible-qos"
    assert lasting.publishers == []
    assert velocities(Wire([base()], connected=False)).connect().code == "base-not-connected"


def twist(linear_m_s: float) -> Any:
    return SimpleNamespace(linear=SimpleNamespace(x=linear_m_s, y=0.0), angular=SimpleNamespace(z=0.0))


def test_only_commands_of_others_are_reported() -> None:
    wire, taken = Wire([base()]), []
    mine = velocities(wire, take=lambda twist, sender: taken.append((twist, sender)))
    assert mine.connect() is None
    assert mine.connect() is None
    (take,) = wire.takers
    mine.send(Command(0.1, 0.0))
    own, other = twist(0.1), twist(0.2)
    for read, sender in [
        (other, "/vsnbench_17"),
        (own, "/joystick"),
        (own, ""),
        (other, ""),
        (own, "/vsnbench_17 (no. 2)"),
    ]:
        take(lambda read=read: read, sender)
    assert taken == [(own, "/joystick"), (other, "")]
