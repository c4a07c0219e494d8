"""Reads robot profiles: embedded profiles by name, others by the path of their YAML file."""

from pathlib import Path
from typing import Self

from pydantic import model_validator

from vsnbench.errors import RobotError, UsageError
from vsnbench.robots.ros.interface_kinds import KnownInterface
from vsnbench.ros.ros2.interface import in_namespace
from vsnbench.settings.validation import SettingsFault
from vsnbench.settings.yaml_file import read_settings, settings_faults
from vsnbench.values.robot_profile import IDEAL_BASE, BaseDynamics, RobotProfile


class _ProfileFile(RobotProfile):
    """A profile with a validated interface."""

    interface: KnownInterface | None = None

    @model_validator(mode="after")
    def _with_cameras_of_topics(self) -> Self:
        if unknown := set(getattr(self.interface, "cameras", ())) - set(self.cameras):
            role = min(unknown)
            raise ValueError(f"interface.cameras has topics of a {role} camera, but cameras has none: state its mount")
        return self


_DIRECTORY = Path(__file__).with_name("profiles")
ANNOTATED_EXAMPLE = Path(__file__).with_name("annotated_profile.yaml")
"""A template for the profile of another robot, with every field explained."""


def embedded_profiles() -> dict[str, Path]:
    """Return the files of the embedded profiles by name."""
    return {path.stem: path for path in sorted(_DIRECTORY.glob("*.yaml"))}


def is_profile(name: str) -> bool:
    """Return whether a name is that of a profile or its file, with or without a namespace."""
    without = name.partition("@")[0]
    return without in embedded_profiles() or without.endswith((".yaml", ".yml"))


def profile_path(name_or_path: str | Path) -> Path:
    """Return the file of an embedded profile, or the given path, without the namespace.

    Raises:
        UsageError: the profile does not exist.
    """
    name = str(name_or_path)
    path = embedded_profiles().get(name.partition("@")[0], Path(name))
    if not path.is_file():
        raise UsageError(
            f"no robot profile {name!r}",
            advice=f"name an embedded profile ({', '.join(embedded_profiles())}) or the path of a profile file",
            code="unknown-robot",
        )
    return path


def load_profile(name_or_path: str | Path) -> RobotProfile:
    """Read an embedded profile by name, or any profile by the path of its YAML file.

    `NAME@NAMESPACE` is a ROS 2 robot in a namespace: `turtlebot4@robot1`.

    Raises:
        UsageError: the profile does not exist.
        RobotError: the file cannot be read or is invalid; the message names the line and the field.
    """
    name, at, namespace = str(name_or_path).rpartition("@")
    if at and name:
        return in_namespace(load_profile(name), namespace)
    profile = read_settings(profile_path(name_or_path), _ProfileFile, RobotError, "robot profile")
    return profile.given_as(str(name_or_path))


def load_dynamics(path: Path | None, profile: RobotProfile) -> BaseDynamics:
    """Read the behaviour of a simulated base; without a file, return the profile's, or an ideal base.

    Raises:
        RobotError: the file cannot be read or is invalid, or the base of the profile cannot behave like this.
    """
    if path is None:
        return profile.dynamics or IDEAL_BASE
    dynamics = read_settings(path, BaseDynamics, RobotError, "base")
    if fault := dynamics.fault(profile.base):
        raise RobotError(f"{path}: {fault}", advice=f"the limits are those of {profile.name}", code="impossible-base")
    return dynamics


def profile_faults(name_or_path: str | Path) -> list[SettingsFault]:
    """Return all faults of a profile, with lines and fields.

    Raises:
        UsageError: the profile does not exist.
        RobotError: the file cannot be read.
    """
    return settings_faults(profile_path(name_or_path), _ProfileFile, RobotError, "robot profile")
