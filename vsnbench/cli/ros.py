"""`vsnbench ros`: the ROS 1 nodes of the stack: discrete_move, and a simulated robot to rehearse with."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(no_args_is_help=True, rich_markup_mode="rich")

RobotOption = Annotated[str, typer.Option("--robot", help="Profile: turtlebot2, lola2, or the path of your own.")]
RosArguments = Annotated[
    list[str] | None,
    typer.Argument(metavar="[REMAP]...", help="In ROS's own form: /odom:=/base/odom, _timeout_s:=5."),
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

        vsnbench ros discrete-move --robot turtlebot2

        vsnbench ros discrete-move --robot lola2 _timeout_s:=20 /odom:=/lola2/odom

        rosservice call /discrete_move Left 30
    """
    from vsnbench.robots.profiles import load_profile
    from vsnbench.ros4vsn.installation import require_ros

    profile = load_profile(robot)
    require_ros()
    from vsnbench.ros4vsn.discrete_move_node import NODE, DiscreteMoveNode
    from vsnbench.ros4vsn.node import run_node

    run_node(
        NODE, ros_arguments or [], lambda _: DiscreteMoveNode(profile, config), f"serving {profile.ros.discrete_move}"
    )
