"""Robot profiles include the paper's robots, and errors name line and field."""

import math
from pathlib import Path

import pytest

from tests.robots.profile_text import parse_profile
from vsnbench.errors import RobotError, UsageError
from vsnbench.robots.checkup.profile import implausible_values
from vsnbench.robots.profiles import embedded_profiles, load_dynamics, load_profile, profile_path
from vsnbench.ros.ros1.interface import ros1_interface
from vsnbench.ros.ros2.interface import ros2_interface
from vsnbench.values.movement import ActionKind
from vsnbench.values.robot_profile import BaseDynamics, RobotProfile

EXAMPLES = Path(__file__).parents[2] / "examples" / "robots"
TURTLEBOT4 = embedded_profiles()["turtlebot4"].read_text(encoding="utf-8")
TURTLEBOT2 = embedded_profiles()["turtlebot2"].read_text(encoding="utf-8")


def test_the_papers_two_robots_and_three_of_ros_2_are_embedded_under_their_names() -> None:
    kinds = {name: load_profile(name).interface.kind for name in embedded_profiles()}
    assert kinds == {"lola2": "ros1", "turtlebot2": "ros1", "create3": "ros2", "stretch": "ros2", "turtlebot4": "ros2"}
    for name in embedded_profiles():
        assert load_profile(name).name == name


@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("*.yaml")), ids=lambda file: file.stem)
def test_an_example_is_a_profile_without_faults(file: Path) -> None:
    profile = load_profile(file)
    assert profile.name == file.stem
    assert ros2_interface(profile).depth
    assert implausible_values(profile) == []


def test_turtlebot2_drives_by_the_papers_defaults() -> None:
    profile = load_profile("turtlebot2")
    assert (profile.speeds.linear_m_s, profile.speeds.angular_rad_s) == (0.3, 0.5)
    assert profile.speeds.acceleration_share == pytest.approx(1 / 3)
    assert profile.base.max_angular_rad_s == pytest.approx(math.pi, abs=1e-4)


def test_a_profile_is_read_by_its_path(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text(TURTLEBOT2.replace("name: turtlebot2", "name: mine"), encoding="utf-8")
    assert load_profile(mine).name == load_profile(str(mine)).name == "mine"


def test_an_unknown_profile_is_answered_with_the_known_ones() -> None:
    with pytest.raises(UsageError, match=r"'turtlebot3'.*create3, lola2, stretch, turtlebot2, turtlebot4"):
        load_profile("turtlebot3")


def test_a_file_that_is_not_text_is_refused(tmp_path: Path) -> None:
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RobotError, match="cannot read robot profile file"):
        load_profile(binary)


HASHES = {
    "create3": "3106909604c1c0c742b4d313e556f5acccf1c3d22779c2e0c89018fdcdfacbbf",
    "lola2": "0c3a03a568222b36a836cf08ab077e81a94eb246489be3a97a8f662b364a039a",
    "stretch": "2d16b5260012c6e8dbea757238a31d088d0296bdd76c105a731fcb222870b772",
    "turtlebot2": "8e520b9cdb3ae97f59e8c396156fefb69694d5f67075bbb87164e749d48f09f6",
    "turtlebot4": "91ac3b91ee746afe0461945c2867f7b15cf750c278ef1b1013c71add8a722f0f",
}
"""Campaign keys depend on them: a new field of profiles must not change those that do not state it."""


@pytest.mark.parametrize("robot", HASHES)
def test_a_robot_keeps_its_hash(robot: str) -> None:
    assert load_profile(robot).sha256 == HASHES[robot]


def test_a_profile_of_the_older_form_is_the_same_robot() -> None:
    older = TURTLEBOT2.replace("interface:\n  kind: ros1", "ros:")
    assert "ros:" in older
    profile = parse_profile(older, origin="older.yaml")
    assert profile.content() == load_profile("turtlebot2").content()
    assert profile.sha256 == load_profile("turtlebot2").sha256


def test_a_robot_is_known_again_that_a_record_knew_before_its_battery_was_read() -> None:
    older = "\n".join(line for line in TURTLEBOT2.splitlines() if "battery" not in line)
    assert older != TURTLEBOT2.rstrip("\n")
    assert parse_profile(older, origin="older.yaml").sha256 == load_profile("turtlebot2").sha256


def test_what_an_older_record_kept_of_a_robot_is_still_a_profile() -> None:
    content = load_profile("turtlebot2").content()
    names = content.pop("interface")
    assert names.pop("kind") == "ros1"
    kept = RobotProfile.model_validate(content | {"ros": names})
    assert kept.sha256 == load_profile("turtlebot2").sha256


def test_a_base_on_legs_needs_no_wheels_and_its_profile_has_a_hash_of_its_own() -> None:
    legged = "\n".join(line for line in TURTLEBOT2.splitlines() if "track_m" not in line and "wheel_r" not in line)
    profile = parse_profile(legged, origin="legged.yaml")
    assert (profile.base.track_m, profile.base.wheel_radius_m) == (None, None)
    assert profile.sha256 != load_profile("turtlebot2").sha256


def test_a_robot_without_an_interface_can_be_simulated_and_not_be_reached() -> None:
    profile = parse_profile(TURTLEBOT2.split("interface:")[0], origin="mine.yaml")
    assert profile.interface is None
    with pytest.raises(RobotError) as refused:
        ros1_interface(profile)
    assert refused.value.code == "wrong-interface"


def test_a_namespace_says_where_a_robot_is_and_not_which_robot_it_is() -> None:
    one = load_profile("turtlebot4@robot1")
    assert ros2_interface(one).odometry == "/robot1/odom"
    assert ros2_interface(load_profile("turtlebot4")).odometry == "/odom"
    assert one.sha256 == load_profile("turtlebot4").sha256
    assert ros2_interface(load_profile("stretch@robot1")).command == "/stretch/cmd_vel"
    for name, code in (("turtlebot2@robot1", "wrong-interface"), ("turtlebot4@two words", "invalid-namespace")):
        with pytest.raises(RobotError) as refused:
            load_profile(name)
        assert refused.value.code == code


FRAMES = "tf: {odom_frame: odom, base_frame: base_link}"


def test_frames_replace_the_odometry_topic_and_older_profiles_keep_their_hash() -> None:
    framed = parse_profile(TURTLEBOT2.replace("odometry: /odom", FRAMES), origin="mine.yaml")
    names = ros1_interface(framed)
    assert (names.odometry, names.odometry_topic, names.tf.static_topic) == ("", "/tf", "/tf_static")
    assert framed.sha256 != load_profile("turtlebot2").sha256
    assert RobotProfile.model_validate(framed.content()).sha256 == framed.sha256
    assert "tf" not in load_profile("turtlebot2").content()["interface"]


def test_the_topic_of_frames_is_in_the_namespace_where_it_begins_without_a_slash(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text(TURTLEBOT4.replace("odometry: odom", "tf: {topic: tf}"), encoding="utf-8")
    assert ros2_interface(load_profile(f"{mine}@robot1")).tf.static_topic == "/robot1/tf_static"


def test_the_dynamics_of_a_profile_are_simulated_and_do_not_change_the_real_robot(tmp_path: Path) -> None:
    file = tmp_path / "late.yaml"
    file.write_text(profile_path("turtlebot2").read_text() + "dynamics: {dead_time_s: 0.1}\n")
    profile = load_profile(file)
    assert profile.sha256 == load_profile("turtlebot2").sha256
    assert load_dynamics(None, profile) == BaseDynamics(dead_time_s=0.1)
    assert load_dynamics(None, load_profile("turtlebot2")).conditions == {}
    file.write_text(profile_path("turtlebot2").read_text() + "dynamics: {deadband_m_s: 0.8}\n")
    with pytest.raises(RobotError, match="deadband_m_s"):
        load_profile(file)


def test_fields_of_a_base_that_older_profiles_do_not_have_change_no_hash_unless_they_are_given() -> None:
    base = load_profile("turtlebot2").base
    assert not base.model_dump().keys() & {"max_lateral_m_s", "min_linear_m_s", "dead_time_s"}
    slower = TURTLEBOT2.replace("  max_angular_rad_s", "  dead_time_s: 0.1\n  max_angular_rad_s", 1)
    profile = parse_profile(slower, origin="mine.yaml")
    assert profile.content()["base"]["dead_time_s"] == 0.1
    assert profile.sha256 != load_profile("turtlebot2").sha256


def test_only_a_base_with_a_lateral_limit_moves_sideways() -> None:
    assert ActionKind.SIDESTEP not in load_profile("turtlebot2").drive_kinds
    legged = "\n".join(line for line in TURTLEBOT2.splitlines() if "track_m" not in line and "wheel_r" not in line)
    profile = parse_profile(legged.replace("  mass_kg", "  max_lateral_m_s: 0.3\n  mass_kg"), origin="legged.yaml")
    assert ActionKind.SIDESTEP in profile.drive_kinds
