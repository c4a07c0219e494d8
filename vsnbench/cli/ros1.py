"""`vsnbench ros1`, and `ros` as it was called: the ROS 1 nodes of the stack: discrete_move, and a simulated robot."""

from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli import options
from vsnbench.lab_file import BUILT_IN_SITE

app = typer.Typer(no_args_is_help=True, rich_markup_mode="rich")

RobotOption = Annotated[str, typer.Option("--robot", help="Profile: turtlebot2, lola2, or the path of your own.")]
RosArguments = Annotated[
    list[str] | None,
    typer.Argument(metavar="REMAP", help="In ROS's own form: /odom:=/base/odom, _timeout_s:=5."),
]


@app.command("discrete-move")
def discrete_move(
    robot: RobotOption = "turtlebot2",
    config: Annotated[
        Path | None, typer.Option("--config", help="Your own discrete_move.yaml instead of the packaged one.")
    ] = None,
    ros_arguments: RosArguments = None,
) -> None:
    """Serve discrete_move: Forward, Backward, Left, Right, Stop; one movement a call, True or False when it is over.

    [bold]Examples[/bold]

        vsnbench ros1 discrete-move --robot turtlebot2

        vsnbench ros1 discrete-move --robot lola2 _timeout_s:=20 /odom:=/odom2

        rosservice call /discrete_move Left 30
    """
    from vsnbench.robots.profiles import load_profile
    from vsnbench.ros1.installation import require_ros1
    from vsnbench.ros1.interface import ros1_interface

    profile = load_profile(robot)
    served = ros1_interface(profile).discrete_move
    require_ros1()
    from vsnbench.ros1.discrete_move_node import NODE, DiscreteMoveNode
    from vsnbench.ros1.node import run_node

    run_node(
        NODE, ros_arguments or [], lambda _: DiscreteMoveNode(profile, config), f"serving {served}", serves=[served]
    )


@app.command("simulate")
def simulate(
    site: options.PlayedSite = BUILT_IN_SITE,
    robot: RobotOption = "turtlebot2",
    rate_factor: options.RateFactor = 1.0,
    noise: options.Noise = False,
    command_lag: options.CommandLag = 0.0,
    odometry_rate: options.OdometryRate = None,
    pretend_real: options.PretendReal = False,
    ros_arguments: RosArguments = None,
) -> None:
    """Be the robot: base and camera on the topics of its profile, around the embedded world, in real time.

    A lab rehearses with it: everything else of the stack, discrete_move and vsnbench run, is what drives the real one.

    [bold]Examples[/bold]

        vsnbench ros1 simulate --site apartment --robot turtlebot2

        vsnbench ros1 simulate --robot lola2 --noise --rate-factor 2
    """
    from vsnbench.protocol.site import load_site
    from vsnbench.robots.profiles import load_profile
    from vsnbench.ros1.installation import require_ros1

    profile, place = load_profile(robot), load_site(site)
    require_ros1()
    from vsnbench.ros1.node import run_node
    from vsnbench.ros1.simulated_robot_node import NODE, SimulatedRobotNode
    from vsnbench.sensing.simulation import PLACE

    playing = options.simulation_options(rate_factor, noise, command_lag, odometry_rate, pretend_real)
    run_node(
        NODE,
        ros_arguments or [],
        lambda master: SimulatedRobotNode(place, profile, playing, master),
        f"playing {profile.title} in {place.name}",
        serves=[PLACE],
        simulated_time=rate_factor != 1,
    )
