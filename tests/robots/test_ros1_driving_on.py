"""What ends `vsnbench run` with a ROS 1 robot that drives on: a lost model, a cut network, STOP on the page."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.processes import Process, wait_until
from tests.robots.driving_on import (
    LOSSES_OF_TESTS,
    DrivenRobot,
    check_cut_network,
    check_lost_model,
    check_stop_on_page,
)
from tests.robots.ros1_rig import PROFILE, start_base, start_camera, start_server
from tests.ros.ros1.network import Probe, RosNetwork, live_network
from tests.two_machines import two_machines

pytestmark = pytest.mark.ros


@dataclass
class Robot1(DrivenRobot):
    """Base, camera and the node next to the base."""

    network: RosNetwork
    probe: Probe

    def run(self, *words: str) -> Process:
        return self.network.run("--robot", str(PROFILE), *words)

    @property
    def base_moves(self) -> bool:
        return self.probe.speed > 0.05

    def stood_after(self, since_s: float) -> float:
        wait_until(lambda: self.probe.stopped_at(since_s) is not None, "the base stands")
        return (self.probe.stopped_at(since_s) or 0.0) - since_s

    def zeroed_after(self, since_s: float) -> float:
        wait_until(lambda: self.probe.zeroed_at(since_s) is not None, "zero velocity is commanded")
        return (self.probe.zeroed_at(since_s) or 0.0) - since_s


def up(network: RosNetwork) -> Robot1:
    start_base(network)
    start_camera(network)
    start_server(network)
    return Robot1(network, Probe(network))


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot1]:
    with live_network(tmp_path_factory.mktemp("ros")) as network:
        robot = up(network)
        yield robot
        robot.probe.close()


@pytest.mark.parametrize("how", LOSSES_OF_TESTS)
def test_a_lost_model_leaves_a_robot_that_drove_on_at_rest(robot: Robot1, tmp_path: Path, how: str) -> None:
    check_lost_model(robot, how, tmp_path, "--unattended")


@pytest.mark.long
def test_stop_on_the_page_stops_a_robot_that_drives_on(robot: Robot1, tmp_path: Path) -> None:
    check_stop_on_page(robot, tmp_path)


@pytest.mark.long
def test_a_network_that_is_cut_leaves_a_robot_that_drove_on_at_rest(tmp_path: Path) -> None:
    with two_machines() as machines, live_network(tmp_path, machines) as network:
        robot = up(network)
        check_cut_network(robot, machines, tmp_path, "--unattended")
        robot.probe.close()
