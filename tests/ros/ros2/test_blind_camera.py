"""A faulty camera over ROS 2 ends the episode after at most one movement, or a few turns, with the reason."""

import json
from pathlib import Path

import pytest

from tests.robots.blind_camera import BENCHMARK, ENDINGS
from tests.ros.ros2.graph import live_graph

pytestmark = [pytest.mark.ros2, pytest.mark.long]

ATTEMPTS = 4
"""On a machine with other work the odometry may fall silent for a second, and the episode ends for that reason."""


def test_a_faulty_camera_ends_the_episode_with_its_reason(tmp_path: Path) -> None:
    unnoticed = dict(ENDINGS)
    with live_graph(tmp_path, shares_memory=True) as graph:
        for _ in range(ATTEMPTS):
            wanted = [word for fault in unnoticed for word in ("--fault", fault)]
            driven = graph.start(BENCHMARK, "ros2", "--json", "--starts", "2", "--actions", "30", *wanted)
            assert driven.wait(240) == 0, driven.output
            for counts in (json.loads(line) for line in driven.output.splitlines() if line.startswith("{")):
                ending = unnoticed[counts["fault"]]
                assert (counts["ends"], counts["collisions"]) == ({"sensor_lost": 1}, 0), counts
                assert counts["moves"] <= ending.moves, counts
                if ending.says in counts["words"]:
                    del unnoticed[counts["fault"]]
            if not unnoticed:
                break
    assert not unnoticed, driven.output
