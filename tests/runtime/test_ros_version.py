"""A process uses the messages of a single ROS generation, even if both are installed."""

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import sys
from vsnbench.errors import RobotError
from vsnbench.runtime.ros_version import RosGeneration, select_generation
for word in sys.argv[1:]:
    try:
        if word.startswith("ROS"):
            print(select_generation(RosGeneration[word]))
        else:
            print(__import__(word).WHOSE)
    except (RobotError, ImportError) as error:
        print(f"{type(error).__name__}: {error}")
"""


def package(root: Path, name: str, whose: str) -> None:
    (root / name).mkdir(parents=True, exist_ok=True)
    (root / name / "__init__.py").write_text(f"WHOSE = {whose!r}\n")


@pytest.fixture
def homes(tmp_path: Path) -> tuple[Path, Path]:
    """ROS 1 and ROS 2 in separate directories; ROS 1 is first on the path."""
    first, second = tmp_path / "noetic", tmp_path / "jazzy"
    for root, client, whose in ((first, "rospy", "ROS 1"), (second, "rclpy", "ROS 2")):
        for name in (client, "std_msgs", "message_filters"):
            package(root, name, whose)
    package(first, "dynamic_reconfigure", "ROS 1")
    package(first, "kobuki_msgs", "ROS 1")
    package(second, "dock_msgs", "ROS 2")
    return first, second


def output_of(homes: tuple[Path, ...], *words: str) -> list[str]:
    """Return the output of a process that selects a generation and imports modules, with ROS only in `homes`."""
    paths = [*map(str, homes), str(Path(__file__).parents[2])]
    # Without site-packages, where a real ROS may be.
    code = f"import sys; sys.path[:0] = {paths!r}\n{PROGRAM}"
    command = [sys.executable, "-S", "-c", code, *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    return done.stdout.splitlines()


@pytest.mark.parametrize(("generation", "whose"), [("ROS1", "ROS 1"), ("ROS2", "ROS 2")])
def test_messages_are_those_of_the_selected_generation(homes, generation, whose) -> None:
    for order in (homes, homes[::-1]):
        assert output_of(order, generation, "std_msgs", "message_filters") == ["True", whose, whose]


def test_a_package_that_only_the_other_generation_has_is_not_there(homes) -> None:
    assert output_of(homes, "ROS2", "dock_msgs", "kobuki_msgs") == [
        "True",
        "ROS 2",
        "ModuleNotFoundError: no kobuki_msgs of ROS 2, only of the other version",
    ]


def test_other_packages_are_found_as_usual(homes) -> None:
    assert output_of(homes, "ROS2", "dynamic_reconfigure") == ["True", "ROS 1"]


def test_a_workspace_of_ones_own_beside_both_is_searched(homes, tmp_path) -> None:
    package(tmp_path / "overlay", "own_msgs", "mine")
    assert output_of((*homes, tmp_path / "overlay"), "ROS1", "own_msgs") == ["True", "mine"]


def test_a_process_uses_one_ros_version(homes) -> None:
    assert output_of(homes, "ROS1", "ROS1", "ROS2") == [
        "True",
        "True",
        "RobotError: this process already uses ROS 1, whose messages have the names of ROS 2's: use another process",
    ]


def test_a_generation_that_is_not_installed_is_not_spoken(homes) -> None:
    assert output_of(homes[:1], "ROS2", "ROS1", "std_msgs") == ["False", "True", "ROS 1"]
