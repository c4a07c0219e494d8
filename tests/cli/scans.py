"""A scan over ROS beside the same one in the simulator itself."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from tests.processes import Process
from vsnbench.exchange.ros_map import read_ros_map
from vsnbench.sensing.plan_grid import OCCUPIED, PlanGrid

SHORT_DRIVE = "left 2\nforward\n"
_ATTEMPTS = 4
"""On a machine with other work a sensor may fall silent for a second, and a movement fails."""


def scanned_alike(vsnbench: Callable[..., Process], robot: str, folder: Path) -> None:
    """Drive `folder / "drive.txt"` over ROS and in this process's simulator: the maps show the same."""
    for attempt in range(_ATTEMPTS):
        over_ros = folder / f"over-ros-{attempt}.yaml"
        words = ["sites", "scan", "--drive", folder / "drive.txt", "--json", "--output"]
        done = vsnbench(*words, over_ros, "--robot", robot)
        if done.wait(240) == 0 and '"failed_movements": 0' in done.output:
            break
    assert done.popen.returncode == 0, done.output
    simulated = vsnbench(*words, folder / "simulated.yaml", "--robot", f"simulated:{robot.partition('@')[0]}")
    assert simulated.wait(120) == 0, simulated.output
    one, other = read_ros_map(over_ros), read_ros_map(folder / "simulated.yaml")
    assert min(share_of(one, other), share_of(other, one)) > 0.9


def share_of(one: PlanGrid, other: PlanGrid) -> float:
    """Return which share of what is occupied in one map is so in the other, within a cell's diagonal."""
    places = []
    for grid in (one, other):
        rows, columns = np.nonzero(grid.cells == OCCUPIED)
        places.append(grid.in_site(np.column_stack((columns + 0.5, rows + 0.5))))
    away_m, _ = cKDTree(places[1]).query(places[0])
    return float(np.mean(away_m < 1.5 * one.resolution_m))
