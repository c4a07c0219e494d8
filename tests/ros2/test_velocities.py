"""A base is commanded in the type it listens to, once somebody hears it, and what others command is told apart."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tests.ros2.wire import STAMPED, TWIST, base, qos
from vsnbench.motion.controller import STANDSTILL, Command
from vsnbench.robots.profiles import load_profile
from vsnbench.ros2.graph_check import Endpoint
from vsnbench.ros2.interface import Ros2Interface, ros2_interface
from vsnbench.ros2.velocities import Velocities

NAMES = ros2_interface(load_profile("turtlebot4"))


@dataclass
class Publisher:
    kind: str
    sent: list[Command] = field(default_factory=list)
    is_heard: bool = True
    closed: bool = False

    def publish(self, command: Command) -> None:
        assert not self.closed
        self.sent.append(command)

    def close(self) -> None:
        self.closed = True


@dataclass
class Wire:
    """What a node and its graph are to Velocities, and whatever the test puts on the graph."""

    bases: list[Endpoint]
    full_name: str = "/vsnbench_17"
    velocity_quality: Any = field(default_factory=lambda: qos(reliability="RELIABLE"))
    publishers: list[Publisher] = field(default_factory=list)
    heard: bool = True
    takers: list[Callable[[Callable[[], Any], Any], None]] = field(default_factory=list)

    def subscribers(self, topic: str) -> list[Endpoint]:
        assert topic == "/cmd_vel"
        return self.bases

    def sender(self, _topic: str, info: str) -> str:
        return info

    def velocity_publisher(self, topic: str, kind: str) -> Publisher:
        self.publishers.append(Publisher(kind, is_heard=self.heard))
        return self.publishers[-1]

    def listen_to_velocities(self, topic: str, kind: str, take: Callable[[Callable[[], Any], Any], None]) -> None:
        self.takers.append(take)


def velocities(wire: Wire, names: Ros2Interface = NAMES, take: Any = None) -> Velocities:
    return Velocities(wire, wire, names, take)  # type: ignore[arg-type]


def test_nothing_is_sent_before_a_base_listens_and_then_in_its_type() -> None:
    wire = Wire([])
    mine = velocities(wire)
    mine.send(STANDSTILL)
    assert "nobody listens to velocities on /cmd_vel" in str(mine.connect())
    assert wire.publishers == []
    wire.bases = [base(kind=STAMPED)]
    assert mine.connect() is None
    mine.send(Command(0.1, 0.2))
    assert [(one.kind, one.sent) for one in wire.publishers] == [(STAMPED, [Command(0.1, 0.2)])]


def test_a_base_that_comes_back_with_the_other_type_is_commanded_in_that() -> None:
    wire = Wire([base(kind=STAMPED)])
    mine = velocities(wire)
    assert mine.connect() is None
    assert mine.connect() is None
    wire.bases = [base(kind=TWIST)]
    assert mine.connect() is None
    assert [(one.kind, one.closed) for one in wire.publishers] == [(STAMPED, True), (TWIST, False)]


def test_the_profile_decides_where_a_base_listens_to_both() -> None:
    wire = Wire([base(kind=TWIST), base(kind=STAMPED)])
    assert velocities(wire, NAMES.model_copy(update={"command_type": STAMPED})).connect() is None
    assert wire.publishers[0].kind == STAMPED


def test_a_base_that_would_never_hear_or_does_not_hear_yet_is_named() -> None:
    lasting = Wire([base(durability="TRANSIENT_LOCAL")])
    assert str(velocities(lasting).connect()).startswith("/cmd_vel: /base asks for transient local and would never")
    assert lasting.publishers == []
    assert "/base listens on /cmd_vel and is not connected yet" in str(
        velocities(Wire([base()], heard=False)).connect()
    )


def test_only_what_others_command_is_told() -> None:
    wire, told = Wire([base()]), []
    mine = velocities(wire, take=lambda twist, sender: told.append((twist, sender)))
    assert mine.connect() is None
    assert mine.connect() is None
    (take,) = wire.takers
    for sender in ("/vsnbench_17", "/joystick", ""):
        take(lambda: "twist", sender)
    assert told == [("twist", "/joystick"), ("twist", "another node")]
