"""Two machines and the network between them, which can be cut: network namespaces of Linux.

A bridge in a third namespace connects them. When it is cut, both keep their interfaces and lose every packet, as when
an access point loses its power.
"""

import ctypes
import os
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path

import pytest

ROBOT_ADDRESS, WORKSTATION_ADDRESS = "10.77.0.1", "10.77.0.2"
_CLONE_NEWNET = 0x40000000
_HOLDS_A_NAMESPACE = ["unshare", "--net", "sh", "-c", "echo up && exec sleep 3600"]


@cache
def _can_make_networks() -> bool:
    try:
        return subprocess.run(["unshare", "--net", "ip", "link"], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


class TwoMachines:
    """The robot's machine, the workstation, and what connects them."""

    def __init__(self, stack: ExitStack) -> None:
        self._switch, self._workstation = (_namespace(stack) for _ in range(2))

    @property
    def on_workstation(self) -> tuple[str, ...]:
        """Words that start a command on the workstation."""
        return _inside(self._workstation)

    def connect(self) -> None:
        """Create the network, from the robot's machine."""
        _ip("link add name robot0 type veth peer name port0")
        _ip(f"link set port0 netns {self._switch}")
        self._at_switch("link add name port1 type veth peer name station0")
        self._at_switch(f"link set station0 netns {self._workstation}")
        self._at_switch("link add name bridge0 type bridge")
        for port in ("port0", "port1"):
            self._at_switch(f"link set {port} master bridge0 up")
        self._at_switch("link set bridge0 up")
        for inside, interface, address in (
            ((), "robot0", ROBOT_ADDRESS),
            (self.on_workstation, "station0", WORKSTATION_ADDRESS),
        ):
            for words in ("link set lo up", f"address add {address}/24 dev {interface}", f"link set {interface} up"):
                _ip(words, *inside)

    def cut(self) -> None:
        """Lose every packet between the machines from now on."""
        self._at_switch("link set port1 nomaster")

    def mend(self) -> None:
        """Deliver packets again."""
        self._at_switch("link set port1 master bridge0")

    def _at_switch(self, words: str) -> None:
        _ip(words, *_inside(self._switch))


@contextmanager
def two_machines() -> Iterator[TwoMachines]:
    """Put this thread, and the processes and threads that it starts, on the robot's machine."""
    if not _can_make_networks():
        pytest.skip("needs root, and `ip` of iproute2")
    libc = ctypes.CDLL(None, use_errno=True)
    own = Path("/proc/thread-self/ns/net")
    with own.open("rb") as outside, ExitStack() as stack:
        if libc.unshare(_CLONE_NEWNET):
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
        stack.callback(libc.setns, outside.fileno(), _CLONE_NEWNET)
        machines = TwoMachines(stack)
        machines.connect()
        yield machines


def _namespace(stack: ExitStack) -> int:
    """Create a network namespace, and return the process that holds it."""
    holder = subprocess.Popen(_HOLDS_A_NAMESPACE, stdout=subprocess.PIPE, text=True)
    stack.enter_context(holder)
    stack.callback(holder.kill)
    assert holder.stdout is not None
    assert holder.stdout.readline() == "up\n"
    return holder.pid


def _inside(process: int) -> tuple[str, ...]:
    return "nsenter", f"--net=/proc/{process}/ns/net"


def _ip(words: str, *inside: str) -> None:
    subprocess.run([*inside, "ip", *words.split()], check=True)
