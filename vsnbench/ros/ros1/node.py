"""A ROS 1 node that never hangs without a master, ends no other node and leaves signal handlers alone."""

import errno
import logging
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import rosgraph.names
import rospy
import rospy.rostime

from vsnbench.errors import RobotError
from vsnbench.ros.common import node
from vsnbench.ros.common.node import LAST_MESSAGES_S, NodeTask
from vsnbench.ros.ros1.graph import server_of
from vsnbench.ros.ros1.master import Master, MasterError, call_xmlrpc
from vsnbench.runtime.signals import EndAsked

logger = logging.getLogger(__name__)

_WATCH_PERIOD_S = 3.0
_LEAVING_S = 5.0
"""Longest time to tell the master, and the nodes that this node is connected to, that it ends."""


def start_node(name: str, ros_arguments: Sequence[str] = ()) -> Master:
    """Make this process the ROS node `name`, and return its master.

    The caller keeps the signal handlers and must halt the robot on a signal.

    Args:
        name: name of the node; `__name:=` in the arguments overrides it.
        ros_arguments: remappings and private parameters in ROS syntax: `/odom:=/base/odom`, `_timeout_s:=5`.

    Raises:
        RobotError: no master answers, or a node of this name is running.
    """
    master = Master.from_environment()
    master.pid()
    given = next((item.split(":=", 1)[1] for item in ros_arguments if item.startswith("__name:=")), name)
    full_name = rosgraph.names.resolve_name(given, "/")
    if (other := master.live_node(full_name)) is not None:
        # rospy would shut the other node down.
        raise RobotError(
            f"{full_name} is already running on this robot ({_process(other)})",
            advice="end it first, or use another robot",
            code="node-runs-already",
        )
    os.environ.setdefault("ROS_PYTHON_LOG_CONFIG_FILE", str(Path(__file__).with_name("logging.yaml")))
    # With our logging configuration rospy writes no log file, but it would still make ~/.ros/log.
    os.environ.setdefault("ROS_LOG_DIR", tempfile.gettempdir())
    rospy.init_node(name, argv=[name, *ros_arguments], disable_signals=True)
    logging.getLogger("rosout").addFilter(_is_not_from_closing)
    return Master(master.uri, caller=full_name)


def _is_not_from_closing(record: logging.LogRecord) -> bool:
    """Whether a message of rospy is more than the traceback of a thread whose socket this process has closed.

    A receiving thread finds its socket closed at the shutdown, and where a subscriber unregisters (EBADF).
    """
    text = record.getMessage()
    closed = rospy.core.is_shutdown_requested() or f"[Errno {errno.EBADF}]" in text
    return not (closed and text.startswith("Traceback"))


def _process(uri: str) -> str:
    try:
        return f"process {call_xmlrpc(uri, 'getPid', '/vsnbench_probe')} at {uri}"
    except (OSError, LookupError):
        return uri


def leave_network() -> None:
    """End the node of this process, also without its master.

    rospy tells the master without a limit of time: with a network that is cut, that takes as long as TCP tries.
    """
    leaving = threading.Thread(target=rospy.signal_shutdown, args=("closed",), name="leaving ROS", daemon=True)
    leaving.start()
    leaving.join(_LEAVING_S)
    if leaving.is_alive():
        logger.warning("the ROS master does not answer: it may list %s until it is restarted", rospy.get_name())


def require_unserved(name: str, master: Master) -> None:
    """Make sure that no other node serves `name`, because ROS would silently replace that server.

    Raises:
        RobotError: a running node serves it.
    """
    server = server_of(name, master.state())
    if server and server != master.caller and (uri := master.live_node(server)) is not None:
        raise RobotError(
            f"{name} is already served by {server} ({_process(uri)})",
            advice="end that node first",
            code="served-already",
        )


def now_s() -> float:
    """Return the time of control loops: monotonic, or simulated where /use_sim_time is set."""
    return time.monotonic() if rospy.rostime.is_wallclock() else float(rospy.get_time())


def sleep_until(due_s: float) -> None:
    """Sleep until `now_s()` reaches `due_s`; see `ros.common.node.sleep_until`."""
    node.sleep_until(due_s, now_s, lambda: not rospy.rostime.is_wallclock())


class MasterWatch:
    """Logs when the master was restarted or another node took over a service of this node."""

    def __init__(self, master: Master, serves: Sequence[str]) -> None:
        self._master = master
        self._serves = serves
        self._due_s = 0.0
        self._logged: set[str] = set()

    def check(self) -> None:
        """Query the master, at most once per _WATCH_PERIOD_S, and log each fault once."""
        if time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + _WATCH_PERIOD_S
        try:
            state = self._master.state()
            self._master.ask("lookupNode", self._master.caller)
        except LookupError:
            self._log(f"the master at {self._master.uri} was restarted and has lost this node: restart all nodes")
        except MasterError:
            return  # topics work without a master, and the master may come back
        else:
            for name in self._serves:
                server = server_of(name, state)
                if server not in ("", self._master.caller):
                    self._log(f"{name} was taken over by {server}: end one of the two servers")

    def _log(self, text: str) -> None:
        if text not in self._logged:
            self._logged.add(text)
            rospy.logerr(text)


def run_node(
    name: str,
    ros_arguments: Sequence[str],
    make: Callable[[Master], NodeTask],
    what: str,
    *,
    serves: Sequence[str] = (),
    simulated_time: bool = False,
) -> None:
    """Run a node until SIGINT, SIGTERM or SIGHUP, or until another node of its name replaces it.

    Args:
        name: name of the node.
        ros_arguments: see `start_node`.
        make: starts the task of the node.
        what: description of the task for the terminal.
        serves: services that only this node may offer.
        simulated_time: whether this node publishes the time of the network; nodes started later follow it.

    Raises:
        RobotError: no master answers, a node of this name is running or replaces this one, or another node offers one
            of the services.
    """
    ended, replaced = EndAsked().listen(), threading.Event()
    master = start_node(name, ros_arguments)
    if simulated_time:
        rospy.set_param("/use_sim_time", True)
    task = _TaskOnce()

    def on_shutdown() -> None:
        """Close the task; ROS calls this while the topics are open."""
        try:
            task.close()
        finally:
            if not ended:
                replaced.set()
                ended.ask()

    rospy.on_shutdown(on_shutdown)
    for service in serves:
        require_unserved(service, master)
    task.begin(make(master))
    try:
        sys.stderr.write(f"{what}; Ctrl-C ends it\n")
        watch = MasterWatch(master, serves)
        while not ended.wait(1.0):
            watch.check()
    finally:
        leave_network()
        task.close()
    if replaced.is_set():
        raise RobotError(
            f"ROS ended this node, because another node called {master.caller} was started",
            advice="end one of the two nodes",
            code="node-replaced",
        )


class _TaskOnce:
    """Closes a task once; a second thread waits until it is closed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._task: NodeTask | None = None

    def begin(self, task: NodeTask) -> None:
        with self._lock:
            self._task = task

    def close(self) -> None:
        with self._lock:
            if self._task is not None:
                self._task.close()
                self._task = None
                time.sleep(LAST_MESSAGES_S)


def publish_while_open(publisher: rospy.Publisher, message: Any) -> bool:
    """Publish, unless ROS has closed the topic because the node ends; return whether the message was sent.

    Raises:
        rospy.ROSException: the topic is closed while the node runs.
    """
    try:
        publisher.publish(message)
    except rospy.ROSException:
        if not rospy.core.is_shutdown_requested():
            raise
        return False
    return True
