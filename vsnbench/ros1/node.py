"""Become a ROS node without the traps: no hang without a master, no second node that ends the first, no signals taken.

Imported only where ROS is installed.
"""

import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import rosgraph.names
import rospy
import rospy.rostime

from vsnbench.end_signals import EndAsked
from vsnbench.errors import RobotError
from vsnbench.ros1.graph_check import server_of
from vsnbench.ros1.master import Master, MasterError, call_xmlrpc

_WATCH_PERIOD_S = 3.0


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
            f"{full_name} is already running on this robot ({_who(other)})",
            advice="end it first, or choose another robot",
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


def require_unserved(name: str, master: Master) -> None:
    """Make sure that no other node serves `name`: ROS would let us take it over without a word.

    Raises:
        RobotError: a living node serves it; the message names it.
    """
    server = server_of(name, master.state())
    if server and server != master.caller and (uri := master.live_node(server)) is not None:
        raise RobotError(f"{name} is already served by {server} ({_who(uri)})", advice="end it first")


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


class MasterWatch:
    """Notices what a master does without a word: forget us in a restart, and hand our service to another node."""

    def __init__(self, master: Master, serves: Sequence[str]) -> None:
        self._master = master
        self._serves = serves
        self._due_s = 0.0
        self._said: set[str] = set()

    def check(self) -> None:
        """Ask the master, once in _WATCH_PERIOD_S, and say once what is wrong."""
        if time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + _WATCH_PERIOD_S
        try:
            state = self._master.state()
            self._master.ask("lookupNode", self._master.caller)
        except LookupError:
            self._say(f"the master at {self._master.uri} was restarted and does not know this node: restart all nodes")
        except MasterError:
            return  # a master that is gone may come back, and topics go on without it
        else:
            for name in self._serves:
                server = server_of(name, state)
                if server not in ("", self._master.caller):
                    self._say(f"{name} was taken over by {server}: end one of the two servers")

    def _say(self, text: str) -> None:
        if text not in self._said:
            self._said.add(text)
            rospy.logerr(text)


def run_node(
    name: str,
    ros_arguments: Sequence[str],
    make: Callable[[Master], Closable],
    what: str,
    *,
    serves: Sequence[str] = (),
    simulated_time: bool = False,
) -> None:
    """Be a node until SIGINT, SIGTERM or SIGHUP, or until another node of this name takes its place.

    Args:
        name: the node's name.
        ros_arguments: see `start_node`.
        make: what starts the node's work.
        what: what the node does, in words, for the terminal.
        serves: the services that it offers and no other node may.
        simulated_time: whether this node is the clock of the whole network, and nodes started after it follow it.

    Raises:
        RobotError: no master answers, a node of this name runs already or takes our place, or another one serves what
            this one would.
    """
    ended, replaced = EndAsked().listen(), threading.Event()
    master = start_node(name, ros_arguments)
    if simulated_time:
        rospy.set_param("/use_sim_time", True)
    work = _WorkOnce()

    def on_shutdown() -> None:
        """Leave, whoever ends the node: ROS runs this while the topics are open, and closes them after it."""
        try:
            work.close()
        finally:
            if not ended:
                replaced.set()
                ended.ask()

    rospy.on_shutdown(on_shutdown)
    for service in serves:
        require_unserved(service, master)
    work.begin(make(master))
    try:
        sys.stderr.write(f"{what}; Ctrl-C ends it\n")
        watch = MasterWatch(master, serves)
        while not ended.wait(1.0):
            watch.check()
    finally:
        rospy.signal_shutdown("ended")
        work.close()
    if replaced.is_set():
        raise RobotError(
            f"ROS ended this node: another one called {master.caller} has taken its place", advice="end one of the two"
        )


class _WorkOnce:
    """A node's work, closed once, by whichever thread comes first; the other waits for it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._work: Closable | None = None

    def begin(self, work: Closable) -> None:
        with self._lock:
            self._work = work

    def close(self) -> None:
        with self._lock:
            if self._work is not None:
                self._work.close()
                self._work = None
                # The last command leaves through rospy's own threads.
                time.sleep(0.1)


def publish_while_open(publisher: rospy.Publisher, message: Any) -> bool:
    """Publish, unless ROS has closed the topic because this node ends; return whether it went out.

    A thread that still works while the node is ended has nobody left to tell.

    Raises:
        rospy.ROSException: the topic is closed though the node goes on: a fault of ours.
    """
    try:
        publisher.publish(message)
    except rospy.ROSException:
        if not rospy.core.is_shutdown_requested():
            raise
        return False
    return True
