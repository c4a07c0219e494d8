"""Hazard topics of a ROS 2 profile that no node publishes, or that have another type."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.processes import wait_until
from tests.ros.ros2.graph import HERE, PROFILE, Graph2, client_of, live_graph, send_line

pytestmark = pytest.mark.ros2


def profile(directory: Path, bumper: str) -> Path:
    file = directory / "profile.yaml"
    text = PROFILE.read_text().replace("  hazards: hazard_detection\n", "")
    file.write_text(text.replace("  bumper: bumper", f"  bumper: {bumper}"))
    return file


def findings(graph: Graph2, file: Path) -> tuple[int, dict[str, tuple[str, str]]]:
    done = graph.vsnbench("doctor", "--robot", file, "--results", graph.directory / "r", "--json")
    code = done.wait(120)
    checks = json.loads(done.output[done.output.index("{\n") :])["checks"]
    return code, {check["what"]: (check["health"], check["seen"]) for check in checks}


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph2]:
    with live_graph(tmp_path_factory.mktemp("ros2")) as one:
        robot = one.start(HERE / "nodes" / "robot.py")
        wait_until(lambda: "up" in robot.output, "the robot is up")
        send_line(robot, "timeout 0.5")
        yield one


def test_doctor_and_a_session_say_that_a_bumper_topic_is_misspelt(graph: Graph2, tmp_path: Path) -> None:
    _, found = findings(graph, profile(tmp_path, "bumpr"))
    assert found["/bumpr"][0] == "warning"
    assert "/bumper" not in found
    session = client_of(graph, profile(tmp_path, "bumpr"))
    session.close()
    assert "no node publishes /bumpr" in (graph.directory / "client.log").read_text()


@pytest.mark.long
@pytest.mark.parametrize(
    ("bumper", "code", "what", "health", "says"),
    [
        ("bumper", 0, "/bumper", "ok", "std_msgs/msg/Bool, published by /test_robot"),
        ("hazard_detection", 1, "/hazard_detection", "failed", ""),
        ("camera/color/image_raw", 1, "topics", "failed", "/camera/color/image_raw is named for two parts"),
    ],
)
def test_doctor_looks_at_the_type_of_a_bumper_topic(graph, tmp_path, bumper, code, what, health, says) -> None:
    ended, found = findings(graph, profile(tmp_path, bumper))
    assert ended == code, found
    assert found[what][0] == health
    assert says in found[what][1]
