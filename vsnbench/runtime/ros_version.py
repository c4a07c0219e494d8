"""Selection of ROS 1 or ROS 2 for a process; the message packages of both have the same names.

If both are installed for one Python, `import std_msgs` would find the first on the path. A process therefore selects a
version before any import. From then on message packages are found next to this version's client library only.
"""

import importlib.machinery
import importlib.util
import re
import sys
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from types import ModuleType

from vsnbench.errors import RobotError


class RosGeneration(StrEnum):
    """Version of ROS, by the name of its Python client library."""

    ROS1 = "rospy"
    ROS2 = "rclpy"

    @property
    def label(self) -> str:
        """Name for messages."""
        return "ROS 1" if self is RosGeneration.ROS1 else "ROS 2"


_SHARED = re.compile(r"[a-z0-9_]+_(msgs|srvs)|message_filters")
"""Packages that exist in both versions."""
_selected: RosGeneration | None = None


def select_generation(generation: RosGeneration) -> bool:
    """Select the ROS version of this process; returns whether it is installed.

    Raises:
        RobotError: the process uses the other version already.
    """
    global _selected
    if _selected is generation:
        return True
    home = _home_of(generation)
    if home is None:
        return False
    other = next(candidate for candidate in RosGeneration if candidate is not generation)
    if _selected is not None or other.value in sys.modules:
        raise RobotError(
            f"this process already uses {other.label}, whose messages have the names of {generation.label}'s",
            advice="use another process",
        )
    _selected = generation
    elsewhere = _home_of(other)
    if elsewhere not in (None, home):
        sys.meta_path.insert(0, _MessagesOf(generation, home, str(elsewhere)))
    return True


def missing_packages(generation: RosGeneration, needed: Sequence[str]) -> list[str]:
    """Return the Python packages that cannot be imported, after `select_generation`.

    Raises:
        RobotError: the process uses the other version already.
    """
    select_generation(generation)
    return [name for name in needed if not has_module(name)]


def has_module(name: str) -> bool:
    """Return whether a module can be found, without importing it."""
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):
        return False


class _MessagesOf:
    """Finder of the message packages of one version."""

    def __init__(self, generation: RosGeneration, home: str, elsewhere: str) -> None:
        self._generation = generation
        self._home = home
        self._elsewhere = Path(elsewhere)

    def find_spec(
        self, name: str, _path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Return the location of a message package; None for other modules.

        Raises:
            ModuleNotFoundError: only the other version has the package.
        """
        if not _SHARED.fullmatch(name):
            return None
        places = [self._home, *(place for place in sys.path if Path(place) != self._elsewhere)]
        spec = importlib.machinery.PathFinder.find_spec(name, places, target)
        if spec is None and importlib.machinery.PathFinder.find_spec(name, [str(self._elsewhere)]) is not None:
            raise ModuleNotFoundError(f"no {name} of {self._generation.label}, only of the other version", name=name)
        return spec


def _home_of(generation: RosGeneration) -> str | None:
    """Return the directory of a version's client library; None if it is not installed."""
    try:
        spec = importlib.util.find_spec(generation.value)
    except (ImportError, ValueError):
        return None
    return str(Path(spec.origin).parent.parent) if spec is not None and spec.origin else None
