"""`vsnbench robots`: what there is, how it is described, and what is wrong with a profile of one's own."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from tests.cli.console import Answer
from vsnbench.robots.profile_check import doubts_about
from vsnbench.robots.profiles import embedded_profiles, load_profile, parse_profile

Typed = Callable[..., Answer]


def test_real_and_simulated_robots_are_listed(typed: Typed) -> None:
    listed = {row["name"]: row["what"] for row in json.loads(typed("robots", "list", "--json").out)}
    assert "over ROS 1" in listed["turtlebot2"]
    assert "in this process" in listed["simulated:lola2"]


def test_a_shown_profile_reads_back_as_the_same_robot(typed: Typed, tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text(typed("robots", "show", "lola2").out)
    assert load_profile(mine) == load_profile("lola2")


@pytest.mark.parametrize("name", embedded_profiles())
def test_nothing_strikes_about_the_embedded_profiles(name: str) -> None:
    assert doubts_about(load_profile(name)) == []


@pytest.mark.parametrize(
    ("wrong", "right", "says"),
    [
        ("cliff:", "clif:", "interface.clif: there is no such field"),
        (
            "command: /mobile_base",
            "command: mobile base",
            "interface.command: 'mobile base/commands/velocity' is no name in ROS: ",
        ),
        (
            "kind: ros1",
            "kind: ros1\n  bumper_type: kobuki_msgs/Bumper",
            "'kobuki_msgs/Bumper' is none of its words: did you mean kobuki_msgs/BumperEvent?",
        ),
        ("radius_m: 0.177", "radius_m: wide", "base.radius_m: 'wide' is no number: write one, in metres"),
    ],
)
def test_a_mistake_in_a_profile_is_named_with_its_line(
    typed: Typed, tmp_path: Path, wrong: str, right: str, says: str
) -> None:
    text = (Path(__file__).parents[2] / "vsnbench" / "robots" / "profiles" / "turtlebot2.yaml").read_text()
    mine = tmp_path / "mine.yaml"
    mine.write_text(text.replace(wrong, right, 1))
    done = typed("robots", "check", str(mine))
    assert done.code == 1
    assert says in done.err
    assert "mine.yaml:" in done.err


def test_parts_that_do_not_fit_together_are_doubted() -> None:
    text = (Path(__file__).parents[2] / "vsnbench" / "robots" / "profiles" / "turtlebot2.yaml").read_text()
    odd = text.replace("linear_m_s: 0.3", "linear_m_s: 0.9").replace("bumper: /mobile_base/events/bumper", "bumper: ''")
    doubts = " ".join(doubts_about(parse_profile(odd, "odd")))
    assert "speeds.linear_m_s 0.9 is over the base's 0.7" in doubts
    assert "collisions are a person's word" in doubts


def test_a_robot_of_ros2_is_doubted_for_the_same_reasons() -> None:
    names = {"kind": "ros2", "depth": "", "hazards": "", "odometry": "/odom", "battery": "/odom"}
    text = yaml.safe_dump(load_profile("turtlebot4").content() | {"interface": names})
    doubts = " ".join(doubts_about(parse_profile(text, "odd")))
    assert "base.has_bumper and interface.bumper or hazards do not agree" in doubts
    assert "no interface.depth" in doubts
    assert "two parts share the topic /odom" in doubts
