"""The first part of a ROS 2 robot that does not answer is reported; warnings are logged once."""

import logging
import time
from dataclasses import replace
from types import SimpleNamespace

from vsnbench.control.command import Command
from vsnbench.robots.profiles import load_profile
from vsnbench.ros.ros2.docking import Dock
from vsnbench.ros.ros2.graph import Endpoint
from vsnbench.ros.ros2.interface import ros2_interface
from vsnbench.ros.ros2.readiness import Ros2Readiness
from vsnbench.sensing.robot_reports import RobotReports, RobotSnapshot
from vsnbench.values.robot_identity import SimulationAccount

PROFILE = load_profile("turtlebot4")
NAMES = ros2_interface(PROFILE)


class Robot:
    """A robot of which every part answers, until a test changes it."""

    def __init__(self) -> None:
        self.reports = RobotReports(PROFILE)
        self.nodes = ["/vsnbench_500"]
        self.topics = {NAMES.odometry: ["/base"], NAMES.color: ["/camera"], NAMES.depth: ["/camera"]}
        self.kinds: dict[str, str] = {}
        self.dock = Dock(PROFILE, NAMES)
        self.chosen = 0
        self.readiness = Ros2Readiness(
            NAMES,
            self.snapshot,
            lambda: "",
            PROFILE,
            SimpleNamespace(began_s=time.monotonic() - 60, full_name="/vsnbench_500"),
            SimpleNamespace(nodes=lambda: self.nodes, publishers=self.publishers),
            lambda: None,
            self.choose_server,
            self.dock,
        )
        self.report_sensors()

    def publishers(self, topic: str) -> list[Endpoint]:
        kind = "nav_msgs/msg/Odometry" if topic == NAMES.odometry else "sensor_msgs/msg/Image"
        return [Endpoint(node, self.kinds.get(topic, kind), "", None) for node in self.topics.get(topic, [])]

    def snapshot(self) -> RobotSnapshot:
        return self.reports.snapshot()

    def report_sensors(self) -> None:
        self.reports.take_odometry((0.0, 0.0, 0.0), 1.0, NAMES.odometry, "/base")
        for field, topic in (("colors", NAMES.color), ("depths", NAMES.depth)):
            self.reports.take_image(field, 5, b"", 1.0, topic, "/camera")

    def choose_server(self) -> None:
        self.chosen += 1

    def fault(self, warned: set[str] | None = None) -> str:
        """The code of the missing part, or an empty string."""
        missing = self.readiness.missing_part(set() if warned is None else warned)
        return "" if missing is None else missing.code


def test_a_complete_robot_is_ready() -> None:
    robot = Robot()
    assert robot.fault() == ""
    assert robot.chosen == 1


def test_an_earlier_session_is_waited_for_and_a_later_one_is_not() -> None:
    robot = Robot()
    robot.nodes = ["/vsnbench_500", "/vsnbench_501", "/robot1/vsnbench_3", "/vsnbench_doctor"]
    assert robot.fault() == ""
    robot.nodes.append("/vsnbench_499")
    assert robot.fault() == "robot-in-use"


def test_two_publishers_of_one_topic_are_a_fault() -> None:
    robot = Robot()
    robot.topics[NAMES.odometry] = ["/base", "/other"]
    assert robot.fault() == "two-publishers"


def test_another_driving_node_is_waited_for() -> None:
    robot = Robot()
    robot.reports.take_command("/joystick", Command(0.1), rival=True)
    assert robot.fault() == "base-is-driven"


def test_silence_is_explained_by_the_graph() -> None:
    robot = Robot()
    robot.reports = RobotReports(PROFILE)
    assert robot.fault() == "silent-topic"
    robot.kinds[NAMES.odometry] = "geometry_msgs/msg/Pose"
    assert robot.fault() == "wrong-topic-type"
    robot.topics[NAMES.odometry] = []
    assert robot.fault() == "silent-topic"


def test_a_docked_robot_does_not_drive() -> None:
    robot = Robot()
    robot.dock.take_status(SimpleNamespace(is_docked=True))
    assert robot.fault() == "docked"
    assert robot.chosen == 0


def test_warnings_are_logged_once(caplog) -> None:
    robot, warned = Robot(), set()
    robot.dock.take_battery(SimpleNamespace(power_supply_status=1))
    with caplog.at_level(logging.WARNING):
        assert robot.fault(warned) == robot.fault(warned) == ""
    (dock,) = [record.message for record in caplog.records if NAMES.hazards not in record.message]
    assert robot.dock.advice in dock


def test_a_hazard_topic_that_no_node_publishes_is_logged_once_per_session(caplog) -> None:
    robot = Robot()
    with caplog.at_level(logging.WARNING):
        assert robot.fault() == robot.fault() == ""
    (warning,) = [record.message for record in caplog.records]
    assert NAMES.hazards in warning
    assert "interface.hazards" in warning


def test_no_episode_begins_with_a_hazard_topic_of_another_type() -> None:
    robot = Robot()
    robot.topics[NAMES.hazards] = ["/base"]
    assert robot.fault() == "wrong-topic-type"
    robot.kinds[NAMES.hazards] = "irobot_create_msgs/msg/HazardDetectionVector"
    assert robot.fault() == ""


def test_a_simulator_reports_contacts_on_its_own_topic(caplog) -> None:
    robot = Robot()
    simulated = replace(robot.snapshot(), simulation=SimulationAccount.model_construct(site="flat"))
    robot.readiness.snapshot = lambda: simulated
    with caplog.at_level(logging.WARNING):
        assert robot.fault() == ""
    assert not caplog.records
