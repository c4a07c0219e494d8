"""`vsnbench doctor` and a session on a ROS 1 base whose hazard sensors publish their state as std_msgs/Bool."""

import json
import re
import time
from pathlib import Path

import pytest

from tests.robots.client import Client
from tests.robots.ros1_rig import PROFILE, start_server
from tests.ros.ros1.network import HERE, PYTHON_OF_ROS1, Probe, RosNetwork, live_network, wait_until

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory):
    with live_network(tmp_path_factory.mktemp("ros")) as network:
        network.start(HERE / "nodes" / "kinematic_base.py")
        network.start(HERE / "nodes" / "camera.py")
        start_server(network)
        yield network


def profile(directory: Path, **changes: str) -> Path:
    """The profile of the tests' base with Bool topics, without a battery, and with other fields of its interface."""
    text = PROFILE.read_text().replace("  battery: /mobile_base/sensors/core\n", "")
    for name in ("bumper", "cliff", "wheel_drop"):
        topic, kind = changes.get(name, f"/{name}"), changes.get(f"{name}_type", "std_msgs/Bool")
        text = re.sub(rf"  {name}: .*", f"  {name}: {topic}\n  {name}_type: {kind}", text)
    file = directory / "profile.yaml"
    file.write_text(text)
    return file


def findings(network: RosNetwork, file: Path) -> dict[str, tuple[str, str]]:
    done = network.start("-m", "vsnbench.cli.main", "doctor", "--robot", file, "--results", file.parent / "r", "--json")
    done.wait(120)
    assert "Traceback" not in done.output
    checks = json.loads(done.output[done.output.index("{\n") :])["checks"]
    return {check["what"]: (check["health"], check["seen"]) for check in checks}


@pytest.mark.parametrize(("sensor", "says"), [("bumper", "bumper"), ("wheel_drop", "wheel drop")])
def test_doctor_fails_while_a_sensor_is_active(robot: RosNetwork, tmp_path: Path, sensor: str, says: str) -> None:
    states = robot.start(HERE / "nodes" / "hazard_states.py", *_active(sensor))
    try:
        robot.wait_for_publisher("/wheel_drop")
        found = findings(robot, profile(tmp_path))
        assert found["/bumper"] == ("ok", "std_msgs/Bool, published by /hazard_states")
        assert found["hazards"] == ("failed", f"the base reports: {says} (somewhere)")
    finally:
        states.end()


def test_misspelt_and_wrong_topics_are_said_before_a_session(robot: RosNetwork, tmp_path: Path) -> None:
    states = robot.start(HERE / "nodes" / "hazard_states.py", *_active())
    try:
        robot.wait_for_publisher("/wheel_drop")
        found = findings(robot, profile(tmp_path, bumper="/bumpr", cliff_type="kobuki_msgs/CliffEvent"))
        assert found["/bumpr"][0] == "warning"
        assert found["/cliff"] == ("failed", "/cliff is a std_msgs/Bool, not a kobuki_msgs/CliffEvent")
        assert "hazards" not in found
        session = Client(robot, PYTHON_OF_ROS1, profile(tmp_path, bumper="/bumpr"), 6.0)
        session.close()
        assert "no node publishes /bumpr" in (robot.directory / "client.log").read_text()
    finally:
        states.end()


def test_a_session_knows_a_bumper_of_a_kobuki_that_was_pressed_before(robot: RosNetwork) -> None:
    probe = Probe(robot)
    probe.tell("/base/fault", "bumper")
    session = Client(robot, PYTHON_OF_ROS1, PROFILE, 6.0)
    try:
        future, began_s = session.later("begin"), time.monotonic()
        wait_until(lambda: time.monotonic() - began_s > 2.0 or future.done(), "the session could have begun")
        assert not future.done()
        probe.tell("/base/fault", "release")
        assert any("bumper" in problem for problem in future.result(30)["asked"])
    finally:
        session.close()
        probe.tell("/base/fault", "release")
        probe.close()


def _active(*sensors: str) -> list[str]:
    return [f"_{name}:={str(name in sensors).lower()}" for name in ("bumper", "cliff", "wheel_drop")]
