"""Hazard topics of a ROS 2 profile that no node publishes, or that have another type."""

import json
from pathlib import Path

import pytest

from tests.processes import wait_until
from tests.ros2.graph import HERE, PROFILE, Graph2, client_of, live_graph, send_line

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


def test_doctor_and_a_session_say_that_a_bumper_topic_is_misspelt(tmp_path: Path) -> None:
    with live_graph(tmp_path) as graph:
        robot = graph.start(HERE / "nodes" / "robot.py")
        wait_until(lambda: "up" in robot.output, "the robot is up")
        send_line(robot, "timeout 0.5")
        code, found = findings(graph, PROFILE)
        assert code == 0, found
        assert found["/bumper"] == ("ok", "std_msgs/msg/Bool, published by /test_robot")
        code, found = findings(graph, profile(tmp_path, "bumpr"))
        assert found["/bumpr"][0] == "warning"
        assert "/bumper" not in found
        session = client_of(graph, profile(tmp_path, "bumpr"))
        session.close()
        assert "no node publishes /bumpr" in (graph.directory / "client.log").read_text()
        code, found = findings(graph, profile(tmp_path, "hazard_detection"))
        assert code == 1
        assert found["/hazard_detection"][0] == "failed"
        code, found = findings(graph, profile(tmp_path, "camera/color/image_raw"))
        assert code == 1
        assert found["topics"][0] == "failed"
        assert "/camera/color/image_raw is named for two parts" in found["topics"][1]
