"""What ends `vsnbench run` with a ROS 2 robot that drives on: a lost model, a cut network, STOP on the page."""

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
from tests.ros.ros2.graph import (
    HERE,
    PROFILE,
    Graph2,
    live_graph,
    measured_watchdog,
    moves,
    send_line,
    stands_since,
    start_discrete_move,
    zeroed_since,
)
from tests.two_machines import two_machines

pytestmark = pytest.mark.ros2


@dataclass
class Robot2(DrivenRobot):
    """A robot that the workstation steers, or a node next to its base."""

    graph: Graph2
    parts: Process

    def run(self, *words: str) -> Process:
        state = str(measured_watchdog())
        return self.graph.run("--robot", PROFILE, *words, XDG_STATE_HOME=state)

    @property
    def base_moves(self) -> bool:
        return moves(self.parts)

    def stood_after(self, since_s: float) -> float:
        wait_until(lambda: stands_since(self.parts) is not None, "the base stands")
        return (stands_since(self.parts) or 0.0) - since_s

    def zeroed_after(self, since_s: float) -> float:
        wait_until(lambda: zeroed_since(self.parts) is not None, "zero velocity is commanded")
        return (zeroed_since(self.parts) or 0.0) - since_s


def up(graph: Graph2, *, next_to_base: bool) -> Robot2:
    parts = graph.start(HERE / "nodes" / "robot.py", *(["--stamped"] if next_to_base else []))
    wait_until(lambda: "up" in parts.output, "the robot is up")
    if next_to_base:
        start_discrete_move(graph)
    return Robot2(graph, parts)


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot2]:
    """The workstation steers: what a lost model does to a node next to the base is over ROS 1 the same."""
    with live_graph(tmp_path_factory.mktemp("ros2")) as graph:
        yield up(graph, next_to_base=False)


@pytest.mark.parametrize("how", LOSSES_OF_TESTS)
def test_a_lost_model_leaves_a_robot_that_drove_on_at_rest(robot: Robot2, tmp_path: Path, how: str) -> None:
    check_lost_model(robot, how, tmp_path, "--unattended")


@pytest.mark.long
def test_stop_on_the_page_stops_a_robot_that_drives_on(robot: Robot2, tmp_path: Path) -> None:
    check_stop_on_page(robot, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("next_to_base", [True, False])
def test_a_network_that_is_cut_leaves_a_robot_that_drove_on_at_rest(tmp_path: Path, next_to_base: bool) -> None:
    """The node next to the base stops it, or the base's own limit of 0.5 s."""
    with two_machines() as machines, live_graph(tmp_path, machines=machines) as graph:
        robot = up(graph, next_to_base=next_to_base)
        if not next_to_base:
            send_line(robot.parts, "timeout 0.5")
        check_cut_network(robot, machines, tmp_path, "--unattended")
