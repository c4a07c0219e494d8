"""The check-up of topics, base and movements of a ROS 2 robot, by the graph and the received messages."""

from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from tests.ros.ros2.wire import TWIST, Wire, base, qos
from vsnbench.robots.checkup.result import CheckResult
from vsnbench.robots.checkup.ros2 import Ros2Checkup, graph_result
from vsnbench.robots.profiles import load_profile
from vsnbench.ros.ros2.graph import Endpoint
from vsnbench.ros.ros2.interface import ros2_interface
from vsnbench.ros.ros2.topic_service import TopicServiceServer
from vsnbench.sensing.topic_monitor import TopicMessages

PROFILE = load_profile("turtlebot4")
NAMES = ros2_interface(PROFILE)
ODOMETRY = "nav_msgs/msg/Odometry"


def messages(rate_hz: float, senders: tuple[str, ...] = ("/driver",)) -> TopicMessages:
    stamps = [number / rate_hz for number in range(20)]
    return TopicMessages([at_s + 0.01 for at_s in stamps], stamps, [b""], set(senders))


@dataclass
class Listener:
    """The listener of a robot without faults, until a test changes it."""

    node: Any = field(default_factory=lambda: SimpleNamespace(velocity_quality=qos(reliability="RELIABLE")))
    subscribing: dict[str, list[Endpoint]] = field(default_factory=lambda: {NAMES.command: [base()]})
    publishing: dict[str, list[Endpoint]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.checkup = Ros2Checkup(PROFILE)
        self.checkup.listener = self  # type: ignore[assignment]
        self.publishing |= {topic: [base("/driver", kind, "RIHS01_ab")] for topic, kind in self.checkup.topics.items()}
        self.checkup.messages = {topic: messages(30.0) for topic in self.checkup.topics}

    @property
    def graph(self) -> Any:
        return SimpleNamespace(
            publishers=lambda topic: self.publishing.get(topic, []),
            subscribers=lambda topic: self.subscribing.get(topic, []),
        )

    def of_topic(self, topic: str) -> CheckResult:
        return next(result for result in self.checkup._topic_results() if result.what == topic)

    def commands(self) -> list[CheckResult]:
        return list(self.checkup._command_results())

    def mover(self) -> CheckResult:
        return next(iter(self.checkup._mover_results(move=True)))


def test_a_robot_without_faults_is_ok() -> None:
    listener = Listener()
    results = [*listener.checkup._topic_results(), *listener.commands()]
    assert {result.health for result in results} == {"ok"}
    assert "30.0 Hz, 10 ms old" in listener.of_topic(NAMES.odometry).seen


def unpublished(listener: Listener) -> None:
    listener.publishing[NAMES.odometry] = []


def of_another_type(listener: Listener) -> None:
    listener.publishing[NAMES.odometry] = [base("/driver", "geometry_msgs/msg/Pose")]


def sent_by_two(listener: Listener) -> None:
    listener.checkup.messages[NAMES.odometry] = messages(30.0, ("/a", "/b"))


def defined_differently(listener: Listener) -> None:
    listener.subscribing[NAMES.odometry] = [base("/vsnbench_doctor", ODOMETRY, "RIHS01_cd")]


def silent(listener: Listener) -> None:
    listener.checkup.messages[NAMES.odometry] = TopicMessages()


def slow(listener: Listener) -> None:
    listener.checkup.messages[NAMES.odometry] = messages(5.0)


@pytest.mark.parametrize(
    ("change", "health", "shows"),
    [
        (unpublished, "failed", ""),
        (of_another_type, "failed", "geometry_msgs/msg/Pose"),
        (sent_by_two, "failed", "/a and /b"),
        (defined_differently, "warning", "/driver"),
        (silent, "failed", "silent for 5 s"),
        (slow, "warning", "5.0 Hz, 10 ms old; the profile has 20 Hz"),
    ],
)
def test_a_faulty_topic_is_reported(change: Callable[[Listener], None], health: str, shows: str) -> None:
    listener = Listener()
    change(listener)
    result = listener.of_topic(NAMES.odometry)
    assert result.health == health
    assert shows in result.seen
    assert result.advice


def test_a_base_that_does_not_subscribe_fails() -> None:
    (result,) = Listener(subscribing={}).commands()
    assert result.health == "failed"
    incompatible = Listener(subscribing={NAMES.command: [base(durability="TRANSIENT_LOCAL")]})
    assert "transient local" in incompatible.commands()[0].seen


def test_another_steering_node_is_a_warning() -> None:
    steered = Listener(publishing={NAMES.command: [base("/joystick"), base("/discrete_move")]})
    command, joystick = steered.commands()
    assert command.seen == f"{TWIST}, subscribed by /base (best effort, volatile)"
    assert joystick.health == "warning"
    assert "/joystick" in joystick.seen


def test_an_empty_graph_fails_with_advice_on_the_domain() -> None:
    alone = graph_result([])
    assert alone.health == "failed"
    assert "ROS_DOMAIN_ID" in alone.advice
    assert graph_result(["/base"]).health == "ok"


def test_the_dock_is_checked_once_the_base_reports_it() -> None:
    checkup = Listener().checkup
    checkup.messages[NAMES.battery] = TopicMessages()

    def results() -> dict[str, str]:
        return {result.what: result.health.value for result in checkup._base_results(checkup.messages)}

    assert results() == {}
    for is_docked, health in ((True, "failed"), (False, "ok")):
        checkup.dock.take_status(SimpleNamespace(is_docked=is_docked))
        assert results()["dock"] == health


@pytest.mark.parametrize(
    ("types", "health", "shows"),
    [
        ([], "warning", "no node publishes"),
        (["sensor_msgs/msg/Image"], "failed", "sensor_msgs/msg/Image"),
        (["irobot_create_msgs/msg/HazardDetectionVector"], "warning", "irobot_create_msgs is not installed"),
    ],
)
def test_a_hazard_topic_without_reports_is_named(types: list[str], health: str, shows: str) -> None:
    listener = Listener(publishing={NAMES.hazards: [base("/driver", kind) for kind in types]})
    (result,) = listener.checkup._hazard_results()
    assert (result.what, result.health) == (NAMES.hazards, health)
    assert shows in result.seen
    assert result.advice


def test_a_robot_without_a_mover_is_steered_over_the_network() -> None:
    assert "over the network" in Listener().mover().seen


@pytest.mark.parametrize(
    ("answer", "health", "shows"),
    [
        ({"missing": ""}, "ok", "runs on the robot, and answers"),
        (
            {"missing": "", "adapter": {"name": "nav2", "version": "1"}},
            "ok",
            "nav2 1 answers; it executes move",
        ),
        ({"missing": "", "adapter": {"name": ""}}, "failed", "the card has no `name`"),
        ({"missing": "", "adapter": {"name": "x", "movements": ["fly"]}}, "failed", "`movements` has 'fly'"),
        ({"missing": "no odometry on /odom"}, "failed", "no odometry on /odom"),
        ({"movement": "", "answer": False, "reason": "unknown movement ''"}, "failed", "another version of vsnbench"),
    ],
)
def test_a_mover_on_the_robot_has_to_answer(answer: dict[str, Any], health: str, shows: str) -> None:
    wire, asked = Wire(), []
    TopicServiceServer(wire, NAMES.discrete_move, lambda request, _gone: asked.append(request) or answer)
    server = [base("/discrete_move", "std_msgs/msg/String")]
    result = Listener(node=wire, subscribing={f"{NAMES.discrete_move}/question": server}).mover()
    assert asked == [{"request": "ping"}]
    assert result.health == health
    assert shows in result.seen


def test_a_robot_without_velocities_needs_its_adapter() -> None:
    listener = Listener(subscribing={})
    listener.checkup.names = NAMES.model_copy(update={"command": ""})
    assert listener.commands() == []
    result = listener.mover()
    assert result.health == "failed"
    assert "no motion adapter serves it" in result.seen
