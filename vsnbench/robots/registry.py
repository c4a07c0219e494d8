"""Opens robots by name: built-in robots, installed plug-ins and any `package.module:Class`.

Names on the command line (`--robot`):

- `simulated`: a simulated Turtlebot 2 in the site's twin, within this process; the default.
- `simulated:lola2`, `simulated:path/to/profile.yaml`: the same with another profile.
- `simulated:turtlebot2@256x256`: the same with a camera image of that size, cropped at the centre. The record treats it
  as another robot, because it sees other pixels.
- `turtlebot2`, `lola2`, `turtlebot4`, `path/to/profile.yaml`: the robot of that profile over ROS 1, ROS 2 or a motion
  adapter, real or simulated; `turtlebot4@robot1` in a namespace.
- any entry point of the group `vsnbench.robots`, or `package.module:Class`.
"""

import inspect
from dataclasses import replace
from typing import Any

from vsnbench.errors import RobotError, UsageError, VsnbenchError
from vsnbench.plugins import import_factory, plug_ins, source_sha256, unknown_name
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.adapter.interface import AdapterInterface
from vsnbench.robots.contract import Robot
from vsnbench.robots.profiles import embedded_profiles, is_profile, load_profile
from vsnbench.sites.site import Site
from vsnbench.text.sanitize import error_line
from vsnbench.values.observation import Sensor
from vsnbench.values.robot_identity import RobotIdentity, kind_of_class
from vsnbench.values.robot_profile import RobotProfile

ENTRY_POINT_GROUP = "vsnbench.robots"

_SIMULATED = "simulated"
_DEFAULT_PROFILE = "turtlebot2"
_SMALLEST_PX, _LARGEST_PX = 16, 4096


def known_robots() -> list[str]:
    """Return the names that `open_robot` knows: built-in robots, then plug-ins."""
    profiles = list(embedded_profiles())
    built_in = [_SIMULATED, *(f"{_SIMULATED}:{name}" for name in profiles), *profiles]
    return [*built_in, *sorted(set(plug_ins(ENTRY_POINT_GROUP)) - set(built_in))]


def is_simulated(name: str) -> bool:
    """Return whether the name is that of the built-in simulated robot, of which several can run at once."""
    return name.partition(":")[0] == _SIMULATED


def profile_of(name: str) -> RobotProfile | None:
    """Return the profile that a robot's name stands for; None for a plug-in, which has one once it is opened.

    Raises:
        UsageError: the robot or profile does not exist.
        RobotError: its file is invalid.
    """
    if is_simulated(name):
        return _simulated_profile(name)
    if is_profile(name):
        return load_profile(name)
    if ":" in name or name in plug_ins(ENTRY_POINT_GROUP):
        return None
    raise unknown_name("robot", name, known_robots())


def open_robot(
    name: str,
    site: Site | None,
    parameters: ProtocolParameters,
    *,
    noise: bool = False,
    rehearsal: bool = False,
    read: frozenset[Sensor] = frozenset(Sensor),
) -> Robot:
    """Open a robot that is ready to begin an episode. Close it, or use it as a context manager.

    The constructor of a plug-in receives `site` and `parameters` as keyword arguments if it has such parameters.

    Args:
        name: see the module's docstring.
        site: site of the robot; None for a real robot in a place without a site file.
        parameters: lengths of its moves and turns.
        noise: whether a simulated robot's sensors have noise.
        rehearsal: whether a simulated robot is treated as a real one, which an operator places and judges.
        read: sensors that are used. A simulated robot renders colours and labels only if they are.

    Raises:
        UsageError: the robot or profile does not exist, or an option does not apply to it.
        RobotError: the robot cannot be reached or used.
    """
    if is_simulated(name):
        from vsnbench.robots.simulated import SimulatedRobot
        from vsnbench.simulator.dynamics.noise import NoiseSettings

        profile = _simulated_profile(name)
        if site is None:
            raise UsageError(f"robot {name} is simulated and needs a site", advice="name one with --site")
        if rehearsal:
            from vsnbench.robots.rehearsal import RehearsalRobot

            return RehearsalRobot(site, profile, parameters, NoiseSettings() if noise else None, read)
        return SimulatedRobot(site, profile, parameters, NoiseSettings() if noise else None, read)
    if noise:
        raise UsageError(f"--noise does not apply to robot {name}, which is not simulated", advice="leave it out")
    if rehearsal:
        raise UsageError(
            f"robot {name} is not simulated in this process, so it cannot rehearse",
            advice="for a rehearsal over ROS, use `vsnbench robots simulate ROBOT --rehearse`",
        )
    if is_profile(name):
        return _checked_site(_profile_robot(load_profile(name), parameters), name, site)
    return _checked_site(_plug_in_robot(name, site, parameters), name, site)


def _simulated_profile(name: str) -> RobotProfile:
    """Return the profile that a simulated robot's name stands for, with the size of its camera image.

    Raises:
        UsageError: the profile does not exist, or the size is invalid.
    """
    profile_name, _, size = name.partition(":")[2].partition("@")
    profile = load_profile(profile_name or _DEFAULT_PROFILE)
    if not size:
        return profile
    sides = [int(side) for side in size.split("x") if side.isdecimal() and len(side) <= 4]
    if len(sides) != 2 or not all(_SMALLEST_PX <= side <= _LARGEST_PX for side in sides):
        raise UsageError(
            f"robot {name}: invalid image size {size!r}",
            advice=f"write WIDTHxHEIGHT, {_SMALLEST_PX} to {_LARGEST_PX} pixels each: "
            f"simulated:{profile_name or _DEFAULT_PROFILE}@256x256",
            code="invalid-image-size",
        )
    width, height = sides
    return profile.model_copy(
        update={
            "name": f"{profile.name}-{width}x{height}",
            "title": f"{profile.title}, camera {width} x {height}",
            "camera": profile.camera.cut_to(width, height),
        }
    )


def _profile_robot(profile: RobotProfile, parameters: ProtocolParameters) -> Robot:
    """Open the robot of a profile over its interface."""
    if isinstance(profile.interface, AdapterInterface):
        from vsnbench.robots.adapter.robot import AdapterRobot

        return AdapterRobot(profile, parameters)
    from vsnbench.robots.ros.robot import RosRobot

    return RosRobot(profile, parameters)


def _checked_site(robot: Robot, name: str, site: Site | None) -> Robot:
    """Return the robot, or close and refuse it if it is simulated in another site."""
    simulated_sha256 = robot.identity.site_sha256
    if site is None or simulated_sha256 in ("", site.sha256):
        return robot
    robot.close()
    raise RobotError(
        f"robot {name} is simulated in another site than {site.name}: its site has hash {simulated_sha256[:12]}, the "
        f"run's {site.sha256[:12]}",
        advice="start its simulator with the same --site",
        code="other-site",
    )


def _plug_in_robot(name: str, site: Site | None, parameters: ProtocolParameters) -> Robot:
    installed = plug_ins(ENTRY_POINT_GROUP)
    where = installed.get(name) or (name if ":" in name else "")
    if not where:
        raise unknown_name("robot", name, known_robots())
    factory = import_factory(where, "robot", name, RobotError)
    offered: dict[str, Any] = {"parameters": parameters} | ({} if site is None else {"site": site})
    try:
        robot = factory(**_accepted(factory, offered))
    except VsnbenchError:
        raise
    except (Exception, SystemExit) as error:
        raise RobotError(
            f"robot {name}: cannot create {where}: {error_line(error)}", code="robot-not-created"
        ) from error
    if not isinstance(robot, Robot):
        raise RobotError(
            f"robot {name}: {where} is not a robot",
            advice="write `class MyRobot(vsnbench.Robot)`: see docs/robots.md",
            code="not-a-robot",
        )
    _check_kind(name, where, robot)
    return robot


def identity_of(robot: Robot) -> RobotIdentity:
    """Return a robot's identity, with the hash of its source if it is not a built-in robot."""
    if type(robot).__module__.startswith("vsnbench."):
        return robot.identity
    return replace(robot.identity, code_sha256=source_sha256(type(robot)))


def _check_kind(name: str, where: str, robot: Robot) -> None:
    """Refuse a third party's robot whose results would be pooled with those of a built-in robot."""
    kind, robot_class = robot.identity.kind, type(robot)
    built_in = robot_class.__module__.startswith("vsnbench.")
    if not built_in and kind != kind_of_class(robot_class):
        raise RobotError(
            f"robot {name}: the identity of {where} has kind {kind!r}",
            advice=f"set it to kind_of_class(type(self)), here {kind_of_class(robot_class)!r}",
            code="wrong-robot-kind",
        )


def _accepted(factory: Any, offered: dict[str, Any]) -> dict[str, Any]:
    """Return those of the keyword arguments that the factory accepts."""
    try:
        accepted = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):
        return offered
    if any(parameter.kind is inspect.Parameter.VAR_KEYWORD for parameter in accepted):
        return offered
    names = {parameter.name for parameter in accepted}
    return {name: value for name, value in offered.items() if name in names}
