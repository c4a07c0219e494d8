"""Finds robot profiles: the embedded ones by name, a lab's own by the path of its YAML file."""

from pathlib import Path

from vsnbench.errors import RobotError, UsageError
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.settings_file import parse_settings, read_settings
from vsnbench.robots.interface_kinds import KnownInterface
from vsnbench.ros2.interface import in_namespace


class _ProfileFile(RobotProfile):
    """A profile whose interface is checked, too."""

    interface: KnownInterface | None = None


_DIRECTORY = Path(__file__).with_name("profiles")


def embedded_profiles() -> dict[str, Path]:
    """Return the profiles that ship with vsnbench, by name."""
    return {path.stem: path for path in sorted(_DIRECTORY.glob("*.yaml"))}


def is_profile(name: str) -> bool:
    """Return whether a name on the command line is that of a profile or its file, in a namespace or not."""
    without = name.partition("@")[0]
    return without in embedded_profiles() or without.endswith((".yaml", ".yml"))


def load_profile(name_or_path: str | Path) -> RobotProfile:
    """Read an embedded profile by its name, or any profile by the path of its YAML file.

    `NAME@NAMESPACE` is that robot of ROS 2 in a namespace: `turtlebot4@robot1`.

    Raises:
        UsageError: there is no such profile.
        RobotError: the file cannot be read or breaks the format; the message names the line and the field.
    """
    name, at, namespace = str(name_or_path).rpartition("@")
    if at and name:
        return in_namespace(load_profile(name), namespace)
    path = embedded_profiles().get(str(name_or_path), Path(name_or_path))
    if not path.is_file():
        known = ", ".join(embedded_profiles())
        raise UsageError(
            f"no robot profile {str(name_or_path)!r}",
            advice=f"name an embedded one ({known}) or the path of a profile file",
        )
    return read_settings(path, _ProfileFile, RobotError, "robot profile")


def parse_profile(text: str, origin: str) -> RobotProfile:
    """Read a profile from YAML text; `origin` names it in errors.

    Raises:
        RobotError: the text breaks the format; the message names the line and the field.
    """
    return parse_settings(text, origin, _ProfileFile, RobotError, "robot profile")
