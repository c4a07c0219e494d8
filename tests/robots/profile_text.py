"""Reads a robot profile from a text."""

from pathlib import Path
from tempfile import TemporaryDirectory

from vsnbench.robots.profiles import load_profile
from vsnbench.values.robot_profile import RobotProfile


def parse_profile(text: str, origin: str) -> RobotProfile:
    """Return the profile of a file with this text and name."""
    with TemporaryDirectory() as directory:
        path = Path(directory, origin)
        path.write_text(text)
        return load_profile(path)
