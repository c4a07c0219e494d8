"""Printed commands name a robot as the user did, so that they work when they are typed."""

import re
import shlex
from pathlib import Path
from types import SimpleNamespace

import pytest

from vsnbench.errors import RobotError
from vsnbench.robots.checkup.ros1 import Ros1Checkup
from vsnbench.robots.checkup.ros2 import Ros2Checkup, stored_watchdog_result
from vsnbench.robots.profiles import embedded_profiles, load_profile
from vsnbench.robots.ros.watchdog import watchdog_advice
from vsnbench.ros.ros2.docking import Dock
from vsnbench.ros.ros2.interface import ros2_interface
from vsnbench.values.robot_profile import RobotProfile

TURTLEBOT2, TURTLEBOT4 = (embedded_profiles()[name].read_text() for name in ("turtlebot2", "turtlebot4"))
NAMES = ["turtlebot4", "turtlebot4@robot1", "kbot2.yaml", "my robots/kbot2.yaml", "my robots/it's.yaml@lab/robot2"]


@pytest.fixture(autouse=True)
def directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A directory with profiles whose name in the file is not the name of the file."""
    (tmp_path / "my robots").mkdir()
    for file in ("kbot2.yaml", "my robots/kbot2.yaml", "my robots/it's.yaml"):
        (tmp_path / file).write_text(TURTLEBOT4.replace("name: turtlebot4", "name: kbot-two"))
    (tmp_path / "my robots" / "one.yaml").write_text(TURTLEBOT2)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def robots_in(text: str) -> list[str]:
    """Return the robot of each `doctor`, `serve` and `undock` in a text, as a shell would read it."""
    commands = re.findall(r"vsnbench (?:doctor --robot|robots serve|robots undock) (.*)", text.replace(";", "\n"))
    return [shlex.split(command.replace(", or ", " "))[0] for command in commands]


@pytest.mark.parametrize("name", NAMES)
def test_the_robot_in_a_printed_command_is_that_of_the_user(name: str) -> None:
    profile = load_profile(name)
    server = SimpleNamespace(graph=SimpleNamespace(subscribers=lambda _: [], publishers=lambda _: []))
    checkup = Ros2Checkup(profile)
    checkup.listener = server  # type: ignore[assignment]
    printed = [
        watchdog_advice(profile),
        stored_watchdog_result(profile, simulated=False).advice,
        Dock(profile, ros2_interface(profile)).advice,
        *(result.advice for result in checkup._mover_results(move=False)),
    ]
    robots = [robot for text in printed for robot in robots_in(text)]
    assert robots == [name] * 6
    assert all(load_profile(robot).content() == profile.content() for robot in robots)


@pytest.mark.ros
def test_a_ros_1_server_is_started_with_the_file_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Ros1Checkup, "_client", lambda _: SimpleNamespace(probe=_fail))
    (result,) = Ros1Checkup(load_profile("my robots/one.yaml"))._mover_results(move=False)
    assert robots_in(result.advice) == ["my robots/one.yaml"]


def test_another_namespace_replaces_that_of_the_user() -> None:
    assert load_profile("kbot2.yaml@robot1").given_in("robot2") == "kbot2.yaml@robot2"
    assert load_profile("kbot2.yaml").given_in("robot2") == "kbot2.yaml@robot2"


def test_a_profile_from_a_record_has_its_name_and_namespace() -> None:
    content = load_profile("turtlebot4").content()
    assert RobotProfile(**content).argument == "turtlebot4"
    assert RobotProfile(**content).sha256 == load_profile("turtlebot4@robot1").sha256


def _fail() -> None:
    raise RobotError("no server")
