"""`vsnbench robots`: what there is, how it is described, and what is wrong with a profile of one's own."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from vsnbench.robots.profile_check import doubts_about
from vsnbench.robots.profiles import load_profile, parse_profile


def robots(*words: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "vsnbench.cli.main", "robots", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


def test_real_and_simulated_robots_are_listed() -> None:
    listed = {row["name"]: row["what"] for row in json.loads(robots("list", "--json").stdout)}
    assert "over ROS 1" in listed["turtlebot2"]
    assert "in this process" in listed["simulated:lola2"]


def test_a_shown_profile_reads_back_as_the_same_robot(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text(robots("show", "lola2").stdout)
    assert load_profile(mine) == load_profile("lola2")


@pytest.mark.parametrize("name", ["turtlebot2", "lola2"])
def test_nothing_strikes_about_the_embedded_profiles(name: str) -> None:
    assert doubts_about(load_profile(name)) == []


@pytest.mark.parametrize(
    ("wrong", "right", "says"),
    [
        ("cliff:", "clif:", "interface.clif: there is no such field"),
        ("command: /mobile_base", "command: mobile base", "interface.command: String should match pattern"),
        (
            "kind: ros1",
            "kind: ros1\n  bumper_type: kobuki_msgs/Bumper",
            "interface.bumper_type: Input should be 'kobuki_msgs/BumperEvent'",
        ),
        ("radius_m: 0.177", "radius_m: wide", "base.radius_m: Input should be a valid number"),
    ],
)
def test_a_mistake_in_a_profile_is_named_with_its_line(tmp_path: Path, wrong: str, right: str, says: str) -> None:
    text = (Path(__file__).parents[2] / "vsnbench" / "robots" / "profiles" / "turtlebot2.yaml").read_text()
    mine = tmp_path / "mine.yaml"
    mine.write_text(text.replace(wrong, right, 1))
    done = robots("check", str(mine))
    assert done.returncode == 1
    assert says in done.stderr
    assert "mine.yaml:" in done.stderr


def test_parts_that_do_not_fit_together_are_doubted() -> None:
    text = (Path(__file__).parents[2] / "vsnbench" / "robots" / "profiles" / "turtlebot2.yaml").read_text()
    odd = text.replace("linear_m_s: 0.3", "linear_m_s: 0.9").replace("bumper: /mobile_base/events/bumper", "bumper: ''")
    doubts = " ".join(doubts_about(parse_profile(odd, "odd")))
    assert "speeds.linear_m_s 0.9 is over the base's 0.7" in doubts
    assert "collisions are a person's word" in doubts
