"""What a terminal shows of a scan: the map in the frame in which it is written, and the robot on it."""

import io
import math

import numpy as np
import pytest
from rich.console import Console

from vsnbench.cli.scan_progress import ScanProgress, map_in_letters
from vsnbench.protocol.pose import Pose
from vsnbench.robots.profiles import load_profile
from vsnbench.runner.scan import ScanState
from vsnbench.sensing.occupancy_map import MappingSettings, OccupancyMap


def state(frame: Pose, pose: Pose) -> ScanState:
    """A robot that has looked once from its map's origin at a wall 2 m ahead, and then stands at `pose`."""
    camera = load_profile("turtlebot2").camera.cut_to(160, 120)
    seen = OccupancyMap(MappingSettings())
    seen.observe(np.full((120, 160), 2.0 - camera.mount_forward_m, np.float32), camera, Pose(0.0, 0.0))
    return ScanState(seen, pose, 25, False, False, "", frame)


def side_of_wall(picture: str) -> str:
    """Say on which side of the robot most of the wall is drawn: x to the right, y up."""
    lines = picture.splitlines()
    here = next((r, line.index(mark)) for r, line in enumerate(lines) for mark in line if mark in "→↗↑↖←↙↓↘")
    wall = np.array([(r, c) for r, line in enumerate(lines) for c, mark in enumerate(line) if mark == "#"])
    up, right = np.median(here[0] - wall[:, 0]) * 2, np.median(wall[:, 1] - here[1])
    return ("right" if right > 0 else "left") if abs(right) > abs(up) else ("up" if up > 0 else "down")


@pytest.mark.parametrize(
    ("heading_deg", "arrow", "side"), [(0, "→", "right"), (90, "↑", "up"), (180, "←", "left"), (270, "↓", "down")]
)
def test_the_picture_is_turned_as_the_map_is_written(heading_deg: float, arrow: str, side: str) -> None:
    picture = map_in_letters(state(Pose(6.0, 3.0, math.radians(heading_deg)), Pose(0.0, 0.0)), 20, 76)
    assert arrow in picture
    assert side_of_wall(picture) == side
    assert max(map(len, picture.splitlines())) <= 76
    assert len(picture.splitlines()) <= 20


def test_the_line_says_where_the_robot_stands_in_the_sites_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    progress = ScanProgress()
    heard = Console(width=200, record=True, file=io.StringIO())
    monkeypatch.setattr(progress, "_console", heard)
    progress.tell(state(Pose(6.0, 3.0, math.pi / 2), Pose(1.0, 0.0, math.pi / 2)))
    assert "at (6.00, 4.00) 180°" in heard.export_text()
