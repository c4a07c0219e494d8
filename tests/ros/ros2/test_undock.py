"""`vsnbench robots undock` with a real action server, whose action has the maker's names and another type."""

import signal

import pytest

from tests.processes import Process, wait_until
from tests.ros.ros2.graph import HERE, Graph2, live_graph

pytestmark = pytest.mark.ros2


def serve(graph: Graph2, base: str) -> Process:
    """Start a docked base with the behaviour of its name, and wait until it serves the action."""
    process = graph.start(HERE / "nodes" / "dock.py", base)
    wait_until(lambda: "up" in process.output, "the action is served", 100)
    return process


@pytest.mark.parametrize(
    ("base", "code", "says"),
    [
        ("leaves", 0, "the robot has left its dock"),
        pytest.param("stays", 1, "/undock failed", marks=pytest.mark.long),
        pytest.param("refuses", 1, "the base refused /undock", marks=pytest.mark.long),
    ],
)
def test_the_result_of_the_action_is_reported(tmp_path, base: str, code: int, says: str) -> None:
    with live_graph(tmp_path) as graph:
        serve(graph, base)
        undock = graph.vsnbench("robots", "undock", "create3")
        assert undock.wait(100) == code, undock.output
        assert says in undock.output
        assert undock.output.count("\n") == 1


def test_an_interrupt_cancels_the_action_of_a_hanging_base(tmp_path) -> None:
    with live_graph(tmp_path) as graph:
        base = serve(graph, "hangs")
        undock = graph.vsnbench("robots", "undock", "create3")
        wait_until(lambda: "asked" in base.output or undock.popen.poll() is not None, "the base is asked", 100)
        undock.signal(signal.SIGINT)
        undock.wait(60)
        wait_until(lambda: "cancelled" in base.output, "the base is asked no longer", 60)
