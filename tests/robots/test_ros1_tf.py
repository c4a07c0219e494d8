"""A ROS 1 base with odometry in TF only; frames that do not connect are named."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.robots.client import Client
from tests.robots.ros1_rig import PROFILE
from tests.ros.ros1.network import HERE, PYTHON_OF_ROS1, Probe, RosNetwork, live_network, wait_until

pytestmark = pytest.mark.ros


@contextmanager
def live_tf_robot(directory: Path, *parameters: str) -> Iterator[tuple[RosNetwork, Path]]:
    profile = directory / "tf_base.yaml"
    text = PROFILE.read_text(encoding="utf-8")
    profile.write_text(text.replace("  odometry: /odom\n", "  tf: {odom_frame: odom, base_frame: base_link}\n"))
    with live_network(directory) as network:
        network.start(HERE / "nodes" / "kinematic_base.py", "_heading_deg:=-72")
        network.start(HERE / "nodes" / "camera.py")
        network.start(HERE / "nodes" / "tf_broadcaster.py", *parameters)
        network.wait_for_publisher("/tf")
        network.start("-m", "vsnbench.cli.main", "robots", "serve", str(profile))
        network.wait_for_service("/discrete_move")
        yield network, profile


@pytest.fixture(scope="module")
def connected(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[RosNetwork, Path]]:
    with live_tf_robot(tmp_path_factory.mktemp("tf")) as found:
        yield found


def doctor(network: RosNetwork, profile: Path, *words: str) -> tuple[int, str]:
    command = ["-m", "vsnbench.cli.main", "doctor", "--robot", str(profile), *words]
    done = network.start(*command, "--results", str(network.directory), COLUMNS="300")
    return done.wait(90), done.output


def test_a_base_is_driven_by_the_odometry_of_its_frames(connected) -> None:
    network, profile = connected
    client, probe = Client(network, PYTHON_OF_ROS1, profile, 10.0), Probe(network)
    try:
        client("begin")
        wait_until(lambda: probe.ask("truth"), "the base says where it is")
        x_m, y_m = probe.position
        moved = client("execute", "MOVE_FORWARD")
        assert moved["failure"] == ""
        assert moved["displacement_m"] == pytest.approx(0.25, abs=0.005)
        after_m = probe.position
        assert ((after_m[0] - x_m) ** 2 + (after_m[1] - y_m) ** 2) ** 0.5 == pytest.approx(0.25, abs=0.006)
        before_deg = probe.heading_deg
        turned = client("execute", "TURN_LEFT")
        assert turned["turn_deg"] == pytest.approx(30, abs=0.2)
        assert probe.heading_deg - before_deg == pytest.approx(30, abs=0.3)
    finally:
        client.close()
        probe.close()


@pytest.mark.long
def test_doctor_sees_the_odometry_of_frames_follow_a_turn(connected) -> None:
    code, output = doctor(*connected, "--move")
    assert code == 0, output
    assert "TF connects them" in output
    assert "the odometry turned +30" in output


@pytest.mark.long
def test_frames_that_do_not_connect_are_named_by_doctor_and_by_a_session(tmp_path) -> None:
    with live_tf_robot(tmp_path, "_fixed:=false") as (network, profile):
        code, output = doctor(network, profile)
        said = "odom to base_link: odom has no parent, base_link has no parent; links seen: odom to base_footprint"
        assert code == 1
        assert said in output
        with pytest.raises(AssertionError, match=said):
            Client(network, PYTHON_OF_ROS1, profile, 2.0)
