"""A node's life: whoever ends it, its last command is said while somebody can still hear it."""

import signal

import pytest

from tests.ros1.network import HERE, RosNetwork, wait_until

pytestmark = pytest.mark.ros

LEAVER = HERE / "nodes" / "last_words.py"
LISTENER = HERE / "nodes" / "listener.py"


@pytest.mark.parametrize("ended_by", ["a signal", "another of its name"])
def test_the_last_command_of_a_node_leaves_whoever_ends_it(network: RosNetwork, ended_by: str) -> None:
    leaver = network.start(LEAVER)
    network.wait_for_publisher("/last_words")
    listener = network.start(LISTENER, "/last_words")
    wait_until(lambda: "somebody listens" in leaver.output, "the listener is connected")
    if ended_by == "a signal":
        leaver.signal(signal.SIGTERM)
        assert leaver.wait() == 0
    else:
        network.start(LISTENER, "/elsewhere", "__name:=leaver")
        assert leaver.wait() == 1
        assert "another one called /leaver has taken its place" in leaver.output
    wait_until(lambda: "standing still" in listener.output, "the last command is heard")
    assert "closed topic" not in leaver.output
