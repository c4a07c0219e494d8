"""`vsnbench robots`: list, description, and errors in a user's profile."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.console import Answer
from tests.robots.profile_text import parse_profile
from vsnbench.robots.checkup.profile import implausible_values
from vsnbench.robots.profiles import embedded_profiles, load_profile
from vsnbench.settings.yaml_text import dump_yaml

Typed = Callable[..., Answer]


def test_real_and_simulated_robots_are_listed(typed: Typed) -> None:
    listed = {row["name"]: row["what"] for row in json.loads(typed("robots", "list", "--json").out)}
    assert "over ROS 1" in listed["turtlebot2"]
    assert "in this process" in listed["simulated:lola2"]


def test_a_shown_profile_reads_back_as_the_same_robot(typed: Typed, tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text(typed("robots", "show", "lola2").out)
    assert load_profile(mine).content() == load_profile("lola2").content()


@pytest.mark.parametrize("name", embedded_profiles())
def test_nothing_strikes_about_the_embedded_profiles(name: str) -> None:
    assert implausible_values(load_profile(name)) == []


def test_check_reports_all_faults_of_a_profile_by_line(typed: Typed, tmp_path: Path) -> None:
    text = embedded_profiles()["turtlebot2"].read_text()
    mine = tmp_path / "mine.yaml"
    mine.write_text(text.replace("radius_m: 0.177", "radius_m: 17", 1).replace("cliff:", "clif:", 1))
    answer = typed("robots", "check", str(mine), "--json")
    assert answer.code == 1
    content = json.loads(answer.out)
    assert (content["robot"], content["title"], content["warnings"]) == (str(mine), "", [])
    lines = mine.read_text().splitlines()
    for fault in content["faults"]:
        assert fault["field"].rpartition(".")[2] in lines[fault["line"] - 1]
    found = {fault["field"]: fault["code"] for fault in content["faults"]}
    assert found == {"base.radius_m": "invalid-field", "interface.clif": "unknown-field"}
    assert json.loads(typed("robots", "check", "turtlebot2", "--json").out)["faults"] == []


def test_parts_that_do_not_fit_together_are_doubted() -> None:
    text = (Path(__file__).parents[3] / "vsnbench" / "robots" / "profiles" / "turtlebot2.yaml").read_text()
    odd = text.replace("linear_m_s: 0.3", "linear_m_s: 0.9").replace("bumper: /mobile_base/events/bumper", "bumper: ''")
    doubts = " ".join(implausible_values(parse_profile(odd, "odd.yaml")))
    assert "speeds.linear_m_s 0.9 exceeds base.max_linear_m_s 0.7" in doubts
    assert "the operator has to report collisions" in doubts


@pytest.mark.parametrize(
    ("right", "odd", "says"),
    [
        ("mount_forward_m: -0.087", "mount_forward_m: 0.6", "camera.mount_forward_m 0.6 is more than"),
        ("tilt_deg: 0.0", "tilt_deg: -90.0", "camera.tilt_deg -90: the camera does not see the way ahead"),
        ("depth_min_m: 0.4", "depth_min_m: 9", "camera.depth_min_m 9 is not below"),
    ],
)
def test_a_camera_that_hardly_any_robot_has_is_doubted(right: str, odd: str, says: str) -> None:
    text = embedded_profiles()["turtlebot2"].read_text()
    assert says in " ".join(implausible_values(parse_profile(text.replace(right, odd), "odd.yaml")))


def test_the_annotated_example_is_shown_with_its_comments_and_is_valid(typed: Typed, tmp_path: Path) -> None:
    shown = typed("robots", "show", "--annotated").out
    mine = tmp_path / "mine.yaml"
    mine.write_text(shown)
    assert "# required" in shown
    assert implausible_values(load_profile(mine)) == []
    assert "# measure yours" in typed("robots", "show", "turtlebot2", "--annotated").out


def test_a_robot_of_ros2_is_doubted_for_the_same_reasons() -> None:
    names = {"kind": "ros2", "depth": "", "hazards": "", "odometry": "/odom", "battery": "/odom"}
    text = dump_yaml(load_profile("turtlebot4").content() | {"interface": names})
    doubts = " ".join(implausible_values(parse_profile(text, "odd.yaml")))
    assert "base.has_bumper and interface.bumper or hazards do not agree" in doubts
    assert "no interface.depth" in doubts
    assert "two parts share the topic /odom" in doubts
