"""`vsnbench robots simulate`, `serve` and `undock`: ROS nodes, for the middleware of the robot's profile."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support.options import Rehearse, SimulatedSite
from vsnbench.config import BUILT_IN_SITE
from vsnbench.errors import UsageError

if TYPE_CHECKING:
    from vsnbench.simulator.robot_player import SimulationOptions
    from vsnbench.sites.site import Site
    from vsnbench.values.robot_profile import RobotProfile

Robot = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT", help="Profile: turtlebot2, lola2, turtlebot4, a path; with a ROS 2 namespace NAME@NAMESPACE."
    ),
]
RosArguments = Annotated[
    list[str] | None,
    typer.Argument(metavar="REMAP", help="ROS 1 remappings and parameters: /odom:=/base/odom _timeout_s:=5."),
]


def simulate(
    robot: Robot,
    ros_arguments: RosArguments = None,
    site: SimulatedSite = BUILT_IN_SITE,
    rate_factor: Annotated[
        float, typer.Option("--rate-factor", min=0.05, max=20, help="Simulated seconds per second.")
    ] = 1.0,
    noise: Annotated[bool, typer.Option("--noise", help="Simulate odometry drift and depth noise.")] = False,
    base: Annotated[
        Path | None,
        typer.Option(
            "--base",
            metavar="FILE",
            show_default="as in the profile",
            help="YAML file of the base's behaviour: dead time, motor lag, encoders, noise, slip, odometry rate.",
        ),
    ] = None,
    rehearse: Rehearse = False,
) -> None:
    """Simulate a robot on the ROS topics of its profile, in real time.

    The other programs, `vsnbench robots serve` and `vsnbench run`, run as with the real robot.

    [bold]Examples[/bold]

        vsnbench robots simulate turtlebot2 --site apartment

        vsnbench robots simulate lola2 --noise --rate-factor 2

        vsnbench robots simulate turtlebot2 --base examples/bases/kobuki.yaml

        vsnbench robots simulate turtlebot4@robot1
    """
    from vsnbench.robots.profiles import load_dynamics, load_profile
    from vsnbench.simulator.dynamics.noise import NoiseSettings
    from vsnbench.simulator.robot_player import SimulationOptions
    from vsnbench.sites.site import load_site

    profile, place = load_profile(robot), load_site(site)
    dynamics = load_dynamics(base, profile)
    options = SimulationOptions(rate_factor, NoiseSettings() if noise else None, dynamics, rehearse)
    if _uses_ros1(profile, ros_arguments):
        _simulate_ros1(profile, place, options, ros_arguments or [])
    else:
        _simulate_ros2(profile, place, options)


def serve(
    robot: Robot,
    ros_arguments: RosArguments = None,
    config: Annotated[
        Path | None,
        typer.Option("--config", show_default="packaged", help="Path of a discrete_move.yaml with other settings."),
    ] = None,
) -> None:
    """Serve discrete_move: execute one movement per request (Forward, Backward, Left, Right, Stop).

    ROS 1: required by `vsnbench run`; True after the movement, False if it failed.
    ROS 2: optional, on the robot's own computer; the base also stops when the workstation is lost.

    [bold]Examples[/bold]

        vsnbench robots serve turtlebot2

        vsnbench robots serve lola2 _timeout_s:=20 /odom:=/odom2

        rosservice call /discrete_move Left 30
    """
    from vsnbench.robots.profiles import load_profile

    profile = load_profile(robot)
    if _uses_ros1(profile, ros_arguments):
        _serve_ros1(profile, config, ros_arguments or [])
    else:
        _serve_ros2(profile, config)


def undock(robot: Robot) -> None:
    """Undock a Create 3: it drives backwards and turns around.

    Needs irobot_create_msgs from a ROS 2 distribution; it is not on PyPI.

    [bold]Examples[/bold]

        vsnbench robots undock turtlebot4
    """
    from vsnbench.robots.profiles import load_profile
    from vsnbench.ros.ros2.installation import require_ros2
    from vsnbench.ros.ros2.interface import ros2_interface

    names = ros2_interface(load_profile(robot))
    require_ros2()
    from vsnbench.ros.ros2.docking import undock as leave_dock
    from vsnbench.ros.ros2.node import Ros2Node

    node = Ros2Node("vsnbench_undock", names.root)
    try:
        leave_dock(node, names)
    finally:
        node.close()
    typer.echo("the robot has left its dock")


def _uses_ros1(profile: "RobotProfile", ros_arguments: list[str] | None) -> bool:
    """Return whether a profile is for ROS 1.

    Raises:
        RobotError: the profile has no ROS interface.
        UsageError: there are ROS 1 arguments for a ROS 2 robot.
    """
    from vsnbench.robots.ros.interface_kinds import interface_of
    from vsnbench.values.robot_identity import ROS1

    is_ros1 = interface_of(profile).kind == ROS1
    if ros_arguments and not is_ros1:
        raise UsageError(
            f"{profile.name} uses ROS 2, and {ros_arguments[0]!r} is a ROS 1 argument",
            advice="leave it out; topic names are in the profile",
            code="ros1-argument",
        )
    return is_ros1


def _simulate_ros1(
    profile: "RobotProfile", site: "Site", options: "SimulationOptions", ros_arguments: list[str]
) -> None:
    from vsnbench.ros.ros1.installation import require_ros1

    require_ros1()
    from vsnbench.ros.ros1.node import run_node
    from vsnbench.ros.ros1.simulated_robot_node import NODE, Ros1SimulatedRobot
    from vsnbench.sensing.simulation import PLACE

    run_node(
        NODE,
        ros_arguments,
        lambda master: Ros1SimulatedRobot(site, profile, options, master),
        f"simulating {profile.title} in {site.name}",
        serves=[PLACE],
        simulated_time=options.rate_factor != 1,
    )


def _simulate_ros2(profile: "RobotProfile", site: "Site", options: "SimulationOptions") -> None:
    from vsnbench.ros.ros2.installation import require_ros2
    from vsnbench.ros.ros2.interface import ros2_interface

    names = ros2_interface(profile)
    require_ros2()
    from vsnbench.ros.ros2.node import run_node
    from vsnbench.ros.ros2.simulated_robot_node import NODE, Ros2SimulatedRobot

    run_node(
        NODE,
        names.root,
        lambda node: Ros2SimulatedRobot(node, site, profile, options),
        f"simulating {profile.title} in {site.name}",
    )


def _serve_ros1(profile: "RobotProfile", config: Path | None, ros_arguments: list[str]) -> None:
    from vsnbench.ros.ros1.installation import require_ros1
    from vsnbench.ros.ros1.interface import ros1_interface

    service = ros1_interface(profile).discrete_move
    require_ros1()
    from vsnbench.ros.ros1.discrete_move_node import NODE, Ros1DiscreteMove
    from vsnbench.ros.ros1.node import run_node

    run_node(NODE, ros_arguments, lambda _: Ros1DiscreteMove(profile, config), f"serving {service}", serves=[service])


def _serve_ros2(profile: "RobotProfile", config: Path | None) -> None:
    from vsnbench.ros.ros2.installation import require_ros2
    from vsnbench.ros.ros2.interface import require_velocities, ros2_interface

    names = ros2_interface(profile)
    require_velocities(names)
    require_ros2()
    from vsnbench.ros.ros2.discrete_move_node import NODE, Ros2DiscreteMove
    from vsnbench.ros.ros2.node import run_node

    run_node(
        NODE,
        names.root,
        lambda node: Ros2DiscreteMove(node, profile, config),
        f"executing movements for {names.discrete_move}",
        by_network_alone=True,
    )
