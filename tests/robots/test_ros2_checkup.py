"""What the doctor says of a ROS 2 robot's topics, base and movements, by what the graph knows and what was heard."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import pytest

from tests.ros2.wire import TWIST, Wire, base, qos
from vsnbench.robots import ros2_checkup
from vsnbench.robots.check_result import CheckResult
from vsnbench.robots.profiles import load_profile
from vsnbench.ros2.docking import Dock
from vsnbench.ros2.graph_check import Endpoint
from vsnbench.ros2.interface import ros2_interface
from vsnbench.ros2.questions import Answerer
from vsnbench.sensing.heard import Heard

PROFILE = load_profile("turtlebot4")
NAMES = ros2_interface(PROFILE)
ODOMETRY = "nav_msgs/msg/Odometry"


def often(rate_hz: float, senders: tuple[str, ...] = ("/driver",)) -> Heard:
    stamps = [number / rate_hz for number in range(20)]
    return Heard([at_s + 0.01 for at_s in stamps], stamps, [b""], set(senders))


@dataclass
class Listener:
    """What a TopicListener has found out: of a robot that is well, but for what a test changes."""

    node: Any = field(default_factory=lambda: SimpleNamespace(velocity_quality=qos(reliability="RELIABLE")))
    listening: dict[str, list[Endpoint]] = field(default_factory=lambda: {NAMES.command: [base()]})
    publishing: dict[str, list[Endpoint]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.wanted = ros2_checkup._topics(NAMES)
        self.publishing |= {topic: [base("/driver", kind, "RIHS01_ab")] for topic, kind in self.wanted.items()}
        self.heard = {topic: often(30.0) for topic in self.wanted}

    @property
    def graph(self) -> Any:
        return SimpleNamespace(
            publishers=lambda topic: self.publishing.get(topic, []),
            subscribers=lambda topic: self.listening.get(topic, []),
        )

    def of_topic(self, topic: str) -> CheckResult:
        of_all = ros2_checkup._topic_results(PROFILE, NAMES, self, self.wanted, self.heard)
        return next(result for result in of_all if result.what == topic)

    def commands(self) -> list[CheckResult]:
        return list(ros2_checkup._command_results(NAMES, self))


def test_a_robot_that_is_well_is_all_ok() -> None:
    listener = Listener()
    results = list(ros2_checkup._topic_results(PROFILE, NAMES, listener, listener.wanted, listener.heard))
    assert {result.health for result in [*results, *listener.commands()]} == {"ok"}
    assert "30.0 Hz, 10 ms old" in listener.of_topic(NAMES.odometry).seen


def nobody(listener: Listener) -> None:
    listener.publishing[NAMES.odometry] = []


def of_another_type(listener: Listener) -> None:
    listener.publishing[NAMES.odometry] = [base("/driver", "geometry_msgs/msg/Pose")]


def two(listener: Listener) -> None:
    listener.heard[NAMES.odometry] = often(30.0, ("/a", "/b"))


def defined_otherwise(listener: Listener) -> None:
    listener.listening[NAMES.odometry] = [base("/vsnbench_doctor", ODOMETRY, "RIHS01_cd")]


def silent(listener: Listener) -> None:
    listener.heard[NAMES.odometry] = Heard()


def slow(listener: Listener) -> None:
    listener.heard[NAMES.odometry] = often(5.0)


@pytest.mark.parametrize(
    ("wrong", "health", "says"),
    [
        (nobody, "failed", "nobody publishes it"),
        (of_another_type, "failed", "/odom is a geometry_msgs/msg/Pose, not a nav_msgs/msg/Odometry"),
        (two, "failed", "/a and /b both publish it"),
        (defined_otherwise, "warning", "/driver has another definition of nav_msgs/msg/Odometry"),
        (silent, "failed", "silent for 2 s; /driver publishes best effort, volatile"),
        (slow, "warning", "5.0 Hz, 10 ms old; the profile says 20 Hz"),
    ],
)
def test_what_is_wrong_with_a_topic_is_named(wrong: Callable[[Listener], None], health: str, says: str) -> None:
    listener = Listener()
    wrong(listener)
    result = listener.of_topic(NAMES.odometry)
    assert result.health == health
    assert says in result.seen
    assert result.advice


def test_a_base_that_does_not_listen_and_a_joystick_that_steers_it_too_are_named() -> None:
    deaf = Listener(listening={})
    assert [(result.health, result.seen) for result in deaf.commands()] == [
        ("failed", "nobody listens to velocities on /cmd_vel")
    ]
    lasting = Listener(listening={NAMES.command: [base(durability="TRANSIENT_LOCAL")]})
    assert "asks for transient local" in lasting.commands()[0].seen
    steered = Listener(publishing={NAMES.command: [base("/joystick"), base("/discrete_move")]})
    well, joystick = steered.commands()
    assert well.seen == f"{TWIST}, heard by /base (best effort, volatile)"
    assert (joystick.health, joystick.seen) == ("warning", "/joystick can steer the base, too")


def test_an_empty_graph_is_a_matter_of_domain_and_range() -> None:
    alone = ros2_checkup._graph_result([])
    assert alone.health == "failed"
    assert "ROS_DOMAIN_ID" in alone.advice
    assert ros2_checkup._graph_result(["/base"]).health == "ok"


def test_a_docked_base_and_a_collision_that_nobody_reports_are_said() -> None:
    listener = Listener()
    listener.heard[NAMES.battery] = Heard()
    dock = Dock(PROFILE.name, NAMES)

    def said() -> dict[str, CheckResult]:
        return {one.what: one for one in ros2_checkup._base_results(NAMES, listener, listener.heard, dock)}

    assert "a collision is a person's word" in said()[NAMES.hazards].seen
    assert "dock" not in said()
    dock.take_status(SimpleNamespace(is_docked=True))
    assert (said()["dock"].health, said()["dock"].seen) == ("failed", "the robot stands on its dock")
    dock.take_status(SimpleNamespace(is_docked=False))
    assert said()["dock"].health == "ok"


def test_who_carries_out_movements_is_said_and_has_to_answer() -> None:
    listener = Listener()
    assert "none beside the base" in ros2_checkup._mover_result(PROFILE, NAMES, listener).seen
    wire = Wire()
    Answerer(wire, NAMES.discrete_move, lambda _question, _gone: {"missing": ""})
    question = f"{NAMES.discrete_move}/question"
    beside = replace(listener, node=wire, listening={question: [base("/discrete_move", "std_msgs/msg/String")]})
    assert ros2_checkup._mover_result(PROFILE, NAMES, beside).seen == "beside the base, and answers"
