"""`vsnbench ros2`: the ROS 2 nodes: a simulated robot to rehearse with, discrete_move beside a base; and undocking."""

from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli import options
from vsnbench.lab_file import BUILT_IN_SITE

app = typer.Typer(no_args_is_help=True, rich_markup_mode="rich")

RobotOption = Annotated[
    str, typer.Option("--robot", help="Profile: turtlebot4, create3, stretch, the path of your own; NAME@NAMESPACE.")
]


@app.command("simulate")
def simulate(
    site: options.PlayedSite = BUILT_IN_SITE,
    robot: RobotOption = "turtlebot4",
    rate_factor: options.RateFactor = 1.0,
    noise: options.Noise = False,
    command_lag: options.CommandLag = 0.0,
    odometry_rate: options.OdometryRate = None,
    pretend_real: options.PretendReal = False,
) -> None:
    """Be the robot: base and camera on the topics of its profile, around the embedded world, in real time.

    A lab rehearses with it: vsnbench run, and discrete_move where it is used, are what drives the real one.

    [bold]Examples[/bold]

        export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_DOMAIN_ID=42

        vsnbench ros2 simulate --site apartment --robot turtlebot4

        vsnbench ros2 simulate --robot turtlebot4@robot1 --noise --rate-factor 2
    """
    from vsnbench.protocol.site import load_site
    from vsnbench.robots.profiles import load_profile
    from vsnbench.ros2.installation import require_ros2
    from vsnbench.ros2.interface import ros2_interface

    profile, place = load_profile(robot), load_site(site)
    names = ros2_interface(profile)
    require_ros2()
    from vsnbench.ros2.node import run_node
    from vsnbench.ros2.simulated_robot_node import NODE, SimulatedRobotNode

    playing = options.simulation_options(rate_factor, noise, command_lag, odometry_rate, pretend_real)
    run_node(
        NODE,
        names.root,
        lambda node: SimulatedRobotNode(node, place, profile, playing),
        f"playing {profile.title} in {place.name}",
    )


@app.command("discrete-move")
def discrete_move(
    robot: RobotOption = "turtlebot4",
    config: Annotated[
        Path | None, typer.Option("--config", help="Your own discrete_move.yaml instead of the packaged one.")
    ] = None,
) -> None:
    """Carry out movements beside the base, on the robot itself, for vsnbench run on the workstation.

    Optional: without it vsnbench run steers the base over the network. With it the base also stands still when the
    workstation falls silent.

    [bold]Examples[/bold]

        vsnbench ros2 discrete-move --robot turtlebot4
    """
    from vsnbench.robots.profiles import load_profile
    from vsnbench.ros2.installation import require_ros2
    from vsnbench.ros2.interface import ros2_interface

    profile = load_profile(robot)
    names = ros2_interface(profile)
    require_ros2()
    from vsnbench.ros2.discrete_move_node import NODE, DiscreteMoveNode
    from vsnbench.ros2.node import run_node

    run_node(
        NODE,
        names.root,
        lambda node: DiscreteMoveNode(node, profile, config),
        f"carrying out movements for {names.discrete_move}",
        by_network_alone=True,
    )


@app.command("undock")
def undock(robot: RobotOption = "turtlebot4") -> None:
    """Have a Create 3 leave its dock, through its maker's own action: it drives backwards and turns round.

    It needs irobot_create_msgs, which comes with a distribution of ROS 2 and in no wheel.

    [bold]Examples[/bold]

        vsnbench ros2 undock --robot turtlebot4
    """
    from vsnbench.robots.profiles import load_profile
    from vsnbench.ros2.installation import require_ros2
    from vsnbench.ros2.interface import ros2_interface

    names = ros2_interface(load_profile(robot))
    require_ros2()
    from vsnbench.ros2.docking import undock as leave_dock
    from vsnbench.ros2.node import Ros2Node

    node = Ros2Node("vsnbench_undock", names.root)
    try:
        leave_dock(node, names)
    finally:
        node.close()
    typer.echo("the robot has left its dock")
