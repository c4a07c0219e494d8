"""Finds robot profiles: the embedded ones by name, a lab's own by the path of its YAML file."""

from pathlib import Path

from vsnbench.errors import RobotError, UsageError
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.settings_file import parse_settings, read_settings
from vsnbench.ros1.interface import Ros1Interface


class _ProfileFile(RobotProfile):
    """A profile whose interface is checked, too; another kind joins in a union that `kind` discriminates."""

    interface: Ros1Interface | None = None


_DIRECTORY = Path(__file__).with_name("profiles")


def embedded_profiles() -> dict[str, Path]:
    """Return the profiles that ship with vsnbench, by name."""
    return {path.stem: path for path in sorted(_DIRECTORY.glob("*.yaml"))}


def load_profile(name_or_path: str | Path) -> RobotProfile:
    """Read an embedded profile by its name, or any profile by the path of its YAML file.

    Raises:
        UsageError: there is no such profile.
        RobotError: the file cannot be read or breaks the format; the message names the line and the field.
    """
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
