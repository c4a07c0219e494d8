"""The last command of a node is sent before the node ends."""

import signal
import subprocess
from pathlib import Path

import pytest

from tests.ros.ros1.network import HERE, PYTHON_OF_ROS1, RosNetwork, live_network, wait_until

pytestmark = pytest.mark.ros

LEAVER = HERE / "nodes" / "last_words.py"
LISTENER = HERE / "nodes" / "listener.py"


@pytest.mark.parametrize("ended_by", ["a signal", "another of its name"])
def test_the_last_command_of_an_ended_node_is_sent(network: RosNetwork, ended_by: str) -> None:
    leaver = network.start(LEAVER)
    network.wait_for_publisher("/last_words")
    listener = network.start(LISTENER, "/last_words")
    wait_until(lambda: "connected" in leaver.output, "the listener is connected")
    if ended_by == "a signal":
        leaver.signal(signal.SIGTERM)
        assert leaver.wait() == 0
    else:
        network.start(LISTENER, "/elsewhere", "__name:=leaver")
        assert leaver.wait() == 1
        assert "another node called /leaver was started" in leaver.output
    wait_until(lambda: "standing still" in listener.output, "the last command is heard")
    assert "closed topic" not in leaver.output


SHUTS_DOWN = """
import logging

import rospy

from vsnbench.ros.ros1.node import start_node

logging.basicConfig()
start_node("leaving", [])
rospy.logerr("Traceback of a fault")
rospy.logerr("Traceback of a subscriber that unregistered: [Errno 9] Bad file descriptor")
rospy.signal_shutdown("closed")
rospy.logerr("Traceback of a connection that the shutdown closed")
rospy.logerr("another error")
"""


def test_the_end_of_a_connection_that_the_process_closed_is_no_error(network: RosNetwork, tmp_path: Path) -> None:
    (tmp_path / "leaving.py").write_text(SHUTS_DOWN)
    leaving = network.start(tmp_path / "leaving.py")
    leaving.wait()
    assert "Traceback of a fault" in leaving.output
    assert "another error" in leaving.output
    assert "that the shutdown closed" not in leaving.output
    assert "that unregistered" not in leaving.output


LEAVES = """
import sys

from vsnbench.ros.ros1.node import leave_network, start_node

start_node("leaving", [])
sys.stdout.write("up")
sys.stdout.flush()
sys.stdin.readline()
leave_network()
"""


def test_a_node_ends_although_its_master_does_not_answer(tmp_path: Path) -> None:
    """As when the network is cut: rospy would wait for as long as TCP tries."""
    (tmp_path / "leaving.py").write_text(LEAVES)
    with live_network(tmp_path) as network:
        assert network.roscore is not None
        leaving = network.launch([*PYTHON_OF_ROS1, str(tmp_path / "leaving.py")], {}, subprocess.PIPE)
        wait_until(lambda: "up" in leaving.output, "the node is up")
        network.roscore.signal(signal.SIGSTOP)
        assert leaving.popen.stdin is not None
        leaving.popen.stdin.write(b"\n")
        leaving.popen.stdin.flush()
        assert leaving.wait() == 0
