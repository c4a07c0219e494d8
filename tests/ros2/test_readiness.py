"""The first part of a ROS 2 robot that does not answer is named, with what to do; what is only odd is said once."""

import logging
import time
from types import SimpleNamespace

from vsnbench.robots.profiles import load_profile
from vsnbench.ros2.docking import Dock
from vsnbench.ros2.graph_check import Endpoint
from vsnbench.ros2.interface import ros2_interface
from vsnbench.ros2.readiness import missing_part
from vsnbench.sensing.robot_reports import RobotReports

PROFILE = load_profile("turtlebot4")
NAMES = ros2_interface(PROFILE)


class Link:
    """A client's link to a robot of which every part answers, until it is told otherwise."""

    def __init__(self) -> None:
        self.names, self.profile_name = NAMES, PROFILE.name
        self.node = SimpleNamespace(began_s=time.monotonic() - 60, full_name="/vsnbench_500")
        self.reports = RobotReports(PROFILE)
        self.snapshot = self.reports.snapshot
        self.nodes = ["/vsnbench_500"]
        self.topics = {NAMES.odometry: ["/base"], NAMES.color: ["/camera"], NAMES.depth: ["/camera"]}
        self.kinds: dict[str, str] = {}
        self.graph = SimpleNamespace(nodes=lambda: self.nodes, publishers=self.publishers)
        self.velocities = SimpleNamespace(connect=lambda: None)
        self.dock = Dock(PROFILE.name, NAMES)
        self.unheard = ["/hazard_detection"]
        self.chosen = 0
        self.hear()

    def publishers(self, topic: str) -> list[Endpoint]:
        kind = "nav_msgs/msg/Odometry" if topic == NAMES.odometry else "sensor_msgs/msg/Image"
        return [Endpoint(node, self.kinds.get(topic, kind), "", None) for node in self.topics.get(topic, [])]

    def hear(self) -> None:
        self.reports.take_odometry((0.0, 0.0, 0.0), 1.0, NAMES.odometry, "/base")
        for field, topic in (("colors", NAMES.color), ("depths", NAMES.depth)):
            self.reports.take_image(field, 5, b"", 1.0, topic, "/camera")

    def choose_server(self) -> None:
        self.chosen += 1

    def missing(self, warned: set[str] | None = None) -> str:
        return str(missing_part(self, set() if warned is None else warned) or "")


def test_a_robot_of_which_all_answers_is_ready() -> None:
    link = Link()
    assert link.missing() == ""
    assert link.chosen == 1


def test_an_earlier_session_is_waited_for_and_a_later_one_is_not() -> None:
    link = Link()
    link.nodes = ["/vsnbench_500", "/vsnbench_501", "/robot1/vsnbench_3", "/vsnbench_doctor"]
    assert link.missing() == ""
    link.nodes.append("/vsnbench_499")
    assert link.missing().startswith("/vsnbench_499 drives this robot already")


def test_two_that_publish_one_topic_are_named() -> None:
    link = Link()
    link.topics[NAMES.odometry] = ["/base", "/other"]
    assert link.missing().startswith("/base and /other both publish /odom: end one of them, or give each robot a names")


def test_somebody_else_who_drives_is_waited_for() -> None:
    link = Link()
    link.reports.take_command("/joystick", moves=True)
    assert link.missing().startswith("/joystick is driving the base")


def test_silence_is_explained_by_what_the_graph_knows() -> None:
    link = Link()
    link.reports = RobotReports(PROFILE)
    link.snapshot = link.reports.snapshot
    assert "no odometry on /odom, which /base publishes: is it alive" in link.missing()
    link.kinds[NAMES.odometry] = "geometry_msgs/msg/Pose"
    assert "/odom is a geometry_msgs/msg/Pose, not a nav_msgs/msg/Odometry" in link.missing()
    link.topics[NAMES.odometry] = []
    assert "no odometry on /odom: start the base's driver" in link.missing()


def test_a_docked_robot_does_not_drive() -> None:
    link = Link()
    link.dock.take_status(SimpleNamespace(is_docked=True))
    assert link.missing().startswith("the robot stands on its dock")
    assert link.chosen == 0


def test_what_cannot_be_heard_is_said_once(caplog) -> None:
    link, warned = Link(), set()
    link.dock.take_battery(SimpleNamespace(power_supply_status=1))
    with caplog.at_level(logging.WARNING):
        assert link.missing(warned) == link.missing(warned) == ""
    assert [record.message.partition(" ")[0] for record in caplog.records] == ["the", "/hazard_detection"]
