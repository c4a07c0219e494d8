"""One process speaks ROS 1 or ROS 2, never both: their Python packages of messages have the same names.

Where both are installed for one Python, `import std_msgs` would find whichever comes first on the path. So a process
says which of the two it speaks before it imports any of them, and from then on they are found beside that one's client
library, and never beside the other's.
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
    """A generation of ROS, by the name of its Python client library."""

    ROS1 = "rospy"
    ROS2 = "rclpy"

    @property
    def words(self) -> str:
        """The name for people."""
        return "ROS 1" if self is RosGeneration.ROS1 else "ROS 2"


_SHARED = re.compile(r"[a-z0-9_]+_(msgs|srvs)|message_filters")
"""Packages that both generations may have."""
_spoken: RosGeneration | None = None


def speak(generation: RosGeneration) -> bool:
    """Have this process speak one generation of ROS from now on; returns whether that one is installed.

    Raises:
        RobotError: the process speaks the other one already.
    """
    global _spoken
    if _spoken is generation:
        return True
    home = _home_of(generation)
    if home is None:
        return False
    other = next(one for one in RosGeneration if one is not generation)
    if _spoken is not None or other.value in sys.modules:
        raise RobotError(
            f"this process speaks {other.words} already, whose messages have the names of {generation.words}'s",
            advice="use another process",
        )
    _spoken = generation
    elsewhere = _home_of(other)
    if elsewhere not in (None, home):
        sys.meta_path.insert(0, _MessagesOf(generation, home, str(elsewhere)))
    return True


def missing_packages(generation: RosGeneration, needed: Sequence[str]) -> list[str]:
    """Return the Python packages that cannot be imported, after `speak`.

    Raises:
        RobotError: the process speaks the other generation already.
    """
    speak(generation)
    return [name for name in needed if not _is_there(name)]


def _is_there(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


class _MessagesOf:
    """Finds the packages of messages of one generation."""

    def __init__(self, generation: RosGeneration, home: str, elsewhere: str) -> None:
        self._generation = generation
        self._home = home
        self._elsewhere = Path(elsewhere)

    def find_spec(
        self, name: str, _path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Return where a package of messages is; None for all other modules.

        Raises:
            ModuleNotFoundError: only the other generation has it.
        """
        if not _SHARED.fullmatch(name):
            return None
        places = [self._home, *(place for place in sys.path if Path(place) != self._elsewhere)]
        spec = importlib.machinery.PathFinder.find_spec(name, places, target)
        if spec is None and importlib.machinery.PathFinder.find_spec(name, [str(self._elsewhere)]) is not None:
            raise ModuleNotFoundError(f"no {name} of {self._generation.words}, only another ROS's", name=name)
        return spec


def _home_of(generation: RosGeneration) -> str | None:
    """Return the directory from which a generation's client library would be imported; None where it is not there."""
    try:
        spec = importlib.util.find_spec(generation.value)
    except (ImportError, ValueError):
        return None
    return str(Path(spec.origin).parent.parent) if spec is not None and spec.origin else None
