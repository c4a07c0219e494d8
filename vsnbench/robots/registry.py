"""Finds robots by name: the built-in ones, those of installed plug-ins, and any `package.module:Class`.

Names on the command line (`--robot`):

- `simulated`: a simulated Turtlebot 2 in the site's twin, within this process; the default.
- `simulated:lola2`, `simulated:path/to/profile.yaml`: the same with another profile.
- `simulated:turtlebot2@256x256`: the same robot, whose camera's picture is cut to that shape in the middle and drawn at
  that size; another robot, since it sees other pixels.
- any entry point of the group `vsnbench.robots`, or `package.module:Class`.

- `turtlebot2`, `lola2`, `turtlebot4`, `path/to/profile.yaml`: the real robot of that profile over ROS 1 or ROS 2, or
  whoever plays it; `turtlebot4@robot1` in a namespace.
"""

import inspect
from dataclasses import replace
from typing import Any

from vsnbench.errors import RobotError, UsageError, VsnbenchError
from vsnbench.harmless_text import error_line
from vsnbench.plugins import import_factory, none_so_called, plug_ins, source_sha256
from vsnbench.protocol.observation import Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.robot_identity import RobotIdentity, kind_of_class
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site
from vsnbench.robots.contract import Robot
from vsnbench.robots.profiles import embedded_profiles, is_profile, load_profile

ENTRY_POINT_GROUP = "vsnbench.robots"
DEFAULT_ROBOT = "simulated"

_SIMULATED = "simulated"
_DEFAULT_PROFILE = "turtlebot2"
_SMALLEST_PX, _LARGEST_PX = 16, 4096


def known_robots() -> list[str]:
    """Return the names that `open_robot` knows: built-in ones first, then those of plug-ins, sorted."""
    profiles = list(embedded_profiles())
    built_in = [_SIMULATED, *(f"{_SIMULATED}:{name}" for name in profiles), *profiles]
    return [*built_in, *sorted(set(plug_ins(ENTRY_POINT_GROUP)) - set(built_in))]


def is_simulated(name: str) -> bool:
    """Whether the name is that of our own simulated robot: of it there can be as many as anybody wants."""
    return name.partition(":")[0] == _SIMULATED


def open_robot(
    name: str,
    site: Site | None,
    parameters: ProtocolParameters,
    *,
    noise: bool = False,
    pretend_real: bool = False,
    read: frozenset[Sensor] = frozenset(Sensor),
) -> Robot:
    """Return a robot that is ready to begin an episode; close it, or use it as a context manager.

    A plug-in is called with `site` and `parameters` as keyword arguments, as far as it takes them.

    Args:
        name: see the module's docstring.
        site: where the robot is; None for a place that nobody has surveyed, where only a real one can be.
        parameters: how far it moves and turns.
        noise: whether a simulated robot's sensors are to be as noisy as real ones.
        pretend_real: whether a simulated robot is to play a real one, which a person places and judges.
        read: what somebody looks at; a simulated robot draws neither colours nor labels for nobody.

    Raises:
        UsageError: there is no such robot or profile, or it has no noise to turn on.
        RobotError: the robot cannot be reached or used.
    """
    if is_simulated(name):
        from vsnbench.robots.simulated import SimulatedRobot
        from vsnbench.simulator.noise import NoiseSettings

        profile = _simulated_profile(name)
        if site is None:
            raise UsageError(f"robot {name} is simulated, and nothing says where", advice="name a site with --site")
        if pretend_real:
            from vsnbench.robots.pretended import PretendedRobot

            return PretendedRobot(site, profile, parameters, NoiseSettings() if noise else None, read)
        return SimulatedRobot(site, profile, parameters, NoiseSettings() if noise else None, read)
    if noise:
        raise UsageError(f"robot {name} is not simulated, and its noise is its own", advice="leave --noise out")
    if pretend_real:
        raise UsageError(
            f"robot {name} is not simulated within this process: only {_SIMULATED} robots can pretend to be real",
            advice="over ROS the simulator pretends: `vsnbench ros1 simulate --pretend-real`",
        )
    if is_profile(name):
        from vsnbench.robots.ros_robot import RosRobot

        return _in_its_site(RosRobot(load_profile(name), parameters), name, site)
    return _in_its_site(_plug_in_robot(name, site, parameters), name, site)


def _simulated_profile(name: str) -> RobotProfile:
    """Return the profile that a simulated robot's name means, with the camera's size where one is said.

    Raises:
        UsageError: there is no such profile, or no such size.
    """
    wanted, _, size = name.partition(":")[2].partition("@")
    profile = load_profile(wanted or _DEFAULT_PROFILE)
    if not size:
        return profile
    sides = [int(side) for side in size.split("x") if side.isdecimal() and len(side) <= 4]
    if len(sides) != 2 or not all(_SMALLEST_PX <= side <= _LARGEST_PX for side in sides):
        raise UsageError(
            f"robot {name}: the camera's size {size!r} is none: say WIDTHxHEIGHT in pixels, "
            f"{_SMALLEST_PX} to {_LARGEST_PX} each",
            advice=f"for instance simulated:{wanted or _DEFAULT_PROFILE}@256x256",
        )
    width, height = sides
    return profile.model_copy(
        update={
            "name": f"{profile.name}-{width}x{height}",
            "title": f"{profile.title}, camera {width} x {height}",
            "camera": profile.camera.cut_to(width, height),
        }
    )


def _in_its_site(robot: Robot, name: str, site: Site | None) -> Robot:
    """Return the robot, unless it is played in another site than the run is about: then it is closed and refused."""
    played = robot.identity.site_sha256
    if site is None or played in ("", site.sha256):
        return robot
    try:
        raise RobotError(
            f"robot {name} is simulated in another site than {site.name}: it plays content {played[:12]}, the run is "
            f"about {site.sha256[:12]}",
            advice="start its simulator with the same --site",
        )
    finally:
        robot.close()


def _plug_in_robot(name: str, site: Site | None, parameters: ProtocolParameters) -> Robot:
    installed = plug_ins(ENTRY_POINT_GROUP)
    where = installed.get(name) or (name if ":" in name else "")
    if not where:
        raise none_so_called("robot", name, known_robots())
    factory = import_factory(where, "robot", name, "a robot", RobotError)
    offered: dict[str, Any] = {"parameters": parameters} | ({} if site is None else {"site": site})
    try:
        robot = factory(**_taken(factory, offered))
    except VsnbenchError:
        raise
    except (Exception, SystemExit) as error:
        raise RobotError(f"robot {name}: {where} could not be made: {error_line(error)}") from error
    if not isinstance(robot, Robot):
        raise RobotError(f"robot {name}: {where} is no robot", advice="see docs/robots.md for what it needs")
    _check_kind(name, where, robot)
    return robot


def identity_of(robot: Robot) -> RobotIdentity:
    """Return who a robot is, with the code of a third party's, which it need not hash itself."""
    if type(robot).__module__.startswith("vsnbench."):
        return robot.identity
    return replace(robot.identity, code_sha256=source_sha256(type(robot)))


def _check_kind(name: str, where: str, robot: Robot) -> None:
    """Refuse a third party's robot that would be pooled with ours."""
    said, robot_class = robot.identity.kind, type(robot)
    ours = robot_class.__module__.startswith("vsnbench.")
    if not ours and said != kind_of_class(robot_class):
        raise RobotError(
            f"robot {name}: {where} says that it is {said!r}: the kind of a robot of one's own is "
            f"kind_of_class(type(self)), here {kind_of_class(robot_class)!r}"
        )


def _taken(factory: Any, offered: dict[str, Any]) -> dict[str, Any]:
    """Return the offered keyword arguments that the factory takes."""
    try:
        takes = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):
        return offered
    if any(one.kind is inspect.Parameter.VAR_KEYWORD for one in takes):
        return offered
    names = {one.name for one in takes}
    return {name: value for name, value in offered.items() if name in names}
