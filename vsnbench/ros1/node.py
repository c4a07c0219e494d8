"""Become a ROS node without the traps: no hang without a master, no second node that ends the first, no signals taken.

Imported only where ROS is installed.
"""

import os
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

import rosgraph.names
import rospy
import rospy.rostime

from vsnbench.errors import RobotError
from vsnbench.ros1.master import Master, call_xmlrpc


def start_node(name: str, ros_arguments: Sequence[str] = ()) -> Master:
    """Make this process the ROS node `name`, and return the master that it registered with.

    Signals stay with the caller, who must halt what he drives.

    Args:
        name: the node's name; `__name:=` in the arguments overrides it.
        ros_arguments: remappings and private parameters in ROS's own form, `/odom:=/base/odom`, `_timeout_s:=5`.

    Raises:
        RobotError: no master answers, or a node of this name runs already.
    """
    master = Master.from_environment()
    master.pid()
    given = next((word.split(":=", 1)[1] for word in ros_arguments if word.startswith("__name:=")), name)
    full_name = rosgraph.names.resolve_name(given, "/")
    if (other := master.live_node(full_name)) is not None:
        # ROS itself would shut that one down, in the middle of whatever it does.
        raise RobotError(
            f"{full_name} is already running on this robot ({_who(other)}): end it first, or choose another robot"
        )
    os.environ.setdefault("ROS_PYTHON_LOG_CONFIG_FILE", str(Path(__file__).with_name("logging.yaml")))
    # With our logging configuration rospy writes no log file, but it would still make ~/.ros/log.
    os.environ.setdefault("ROS_LOG_DIR", tempfile.gettempdir())
    rospy.init_node(name, argv=[name, *ros_arguments], disable_signals=True)
    return Master(master.uri, caller=full_name)


def _who(uri: str) -> str:
    try:
        return f"process {call_xmlrpc(uri, 'getPid', '/vsnbench_probe')} at {uri}"
    except (OSError, LookupError):
        return uri


def now_s() -> float:
    """Return the time that control runs on: monotonic, or simulated where /use_sim_time says so."""
    return time.monotonic() if rospy.rostime.is_wallclock() else float(rospy.get_time())


def sleep_until(
    due_s: float, give_up_wall_s: float = 1.0, also: Callable[[], bool] | None = None, pause_s: float = 0.001
) -> None:
    """Sleep until `now_s()` reaches `due_s`, or `also()` is true; never longer than `give_up_wall_s` of real time.

    A simulated clock may stand still for ever, which rospy's own sleep would wait for.
    """
    give_up_s = time.monotonic() + give_up_wall_s
    while (left_s := due_s - now_s()) > 0 and time.monotonic() < give_up_s and not (also is not None and also()):
        if rospy.rostime.is_wallclock() and also is None:
            time.sleep(min(left_s, give_up_wall_s))
        else:
            time.sleep(pause_s)


class Closable(Protocol):
    """A node's work: it runs in threads of its own until it is closed."""

    def close(self) -> None:
        """Stop, and leave the robot standing still."""
        ...


def run_node(
    name: str,
    ros_arguments: Sequence[str],
    make: Callable[[Master], Closable],
    what: str,
    *,
    simulated_time: bool = False,
) -> None:
    """Be a node until SIGINT, SIGTERM or SIGHUP, or until another node of this name takes its place.

    Args:
        name: the node's name.
        ros_arguments: see `start_node`.
        make: what starts the node's work.
        what: what the node does, in words, for the terminal.
        simulated_time: whether this node is the clock of the whole network, and nodes started after it follow it.

    Raises:
        RobotError: no master answers, or a node of this name runs already.
    """
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: ended.set())
    master = start_node(name, ros_arguments)
    if simulated_time:
        rospy.set_param("/use_sim_time", True)
    rospy.on_shutdown(ended.set)
    node = make(master)
    try:
        sys.stderr.write(f"{what}; Ctrl-C ends it\n")
        while not ended.wait(1.0):
            pass
    finally:
        node.close()
        # The last command leaves through rospy's own threads.
        time.sleep(0.1)
        rospy.signal_shutdown("ended")
