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


@pytest.mark.parametrize(
    ("wrong", "right", "says"),
    [
        ("cliff:", "clif:", "interface.clif: unknown field"),
        (
            "command: /mobile_base",
            "command: mobile base",
            "interface.command: 'mobile base/commands/velocity' is not a valid ROS name",
        ),
        (
            "kind: ros1",
            "kind: ros1\n  bumper_type: kobuki_msgs/Bumper",
            "'kobuki_msgs/Bumper' is not allowed: did you mean kobuki_msgs/BumperEvent?",
        ),
        ("mount_forward_m: -0.087", "mount_forward_m: 20", "camera.mount_forward_m: "),
        ("mount_height_m: 0.60", "mount_height_m: 6.0", "camera.mount_height_m: "),
        ("radius_m: 0.177", "radius_m: wide", "base.radius_m: expected a number, got 'wide': write it in metres"),
    ],
)
def test_a_mistake_in_a_profile_is_named_with_its_line(
    typed: Typed, tmp_path: Path, wrong: str, right: str, says: str
) -> None:
    text = (Path(__file__).parents[3] / "vsnbench" / "robots" / "profiles" / "turtlebot2.yaml").read_text()
    mine = tmp_path / "mine.yaml"
    mine.write_text(text.replace(wrong, right, 1))
    done = typed("robots", "check", str(mine))
    assert done.code == 1
    assert says in done.out
    assert "mine.yaml:" in done.out
    assert done.out.endswith("mine.yaml: 1 error\n")


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


def test_a_profile_that_does_not_exist_is_a_usage_error(typed: Typed, tmp_path: Path) -> None:
    answer = typed("robots", "check", str(tmp_path / "mine.yaml"), "--json")
    assert (answer.code, answer.out) == (2, "")


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


@pytest.mark.parametrize("words", [("show",), ("show", "lola2", "--annotated", "--json")], ids=" ".join)
def test_show_needs_a_profile_and_json_has_no_comments(typed: Typed, words: tuple[str, ...]) -> None:
    assert typed("robots", *words).code == 2


def test_a_built_in_profile_is_not_overwritten(typed: Typed) -> None:
    before = embedded_profiles()["turtlebot2"].read_text()
    done = typed("robots", "calibrate", "turtlebot2", "--yes")
    assert done.code == 2
    assert "--output" in done.err
    assert embedded_profiles()["turtlebot2"].read_text() == before


def test_a_robot_of_ros2_is_doubted_for_the_same_reasons() -> None:
    names = {"kind": "ros2", "depth": "", "hazards": "", "odometry": "/odom", "battery": "/odom"}
    text = dump_yaml(load_profile("turtlebot4").content() | {"interface": names})
    doubts = " ".join(implausible_values(parse_profile(text, "odd.yaml")))
    assert "base.has_bumper and interface.bumper or hazards do not agree" in doubts
    assert "no interface.depth" in doubts
    assert "two parts share the topic /odom" in doubts
