"""`vsnbench doctor` on a healthy robot, and on robots with a fault."""

import getpass
import json
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.cli.console import Typed
from tests.ros.ros1.network import HERE, Probe, Process, RosNetwork, live_network, wait_until
from vsnbench import __version__

PROFILE = HERE / "profile_of_test_base.yaml"


def doctor(*words: str, environment: dict[str, str] | None = None) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "vsnbench.cli.main", "doctor", *words]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)


@dataclass
class Patient:
    """A robot whose parts can be broken."""

    network: RosNetwork
    probe: Probe
    server: Process
    results: Path

    def findings(self, *words: str, profile: Path = PROFILE) -> tuple[int, dict[str, tuple[str, str, str]]]:
        """Return the exit code of `doctor`, and health, finding and advice of each check."""
        where = ["--robot", str(profile), "--results", str(self.results), "--json"]
        done = doctor(*where, *words, environment=self.network.environment)
        lines = json.loads(done.stdout)["checks"]
        return done.returncode, {line["what"]: (line["health"], line["seen"], line["advice"]) for line in lines}


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[RosNetwork, Probe, Process]]:
    with live_network(tmp_path_factory.mktemp("ros")) as network:
        network.start(HERE / "nodes" / "kinematic_base.py")
        network.start(HERE / "nodes" / "camera.py")
        server = network.start("-m", "vsnbench.cli.main", "robots", "serve", str(PROFILE))
        network.wait_for_service("/discrete_move")
        probe = Probe(network)
        yield network, probe, server
        probe.close()


@pytest.fixture
def patient(parts, tmp_path) -> Iterator[Patient]:
    network, probe, server = parts
    yield Patient(network, probe, server, tmp_path / "results")
    probe.tell("/base/fault", "good")
    probe.tell("/camera/fault", "good")
    server.signal(signal.SIGCONT)


@pytest.mark.ros
def test_a_healthy_robot_is_ready_and_its_odometry_follows_its_wheels(patient) -> None:
    code, found = patient.findings("--move")
    assert code == 0, found
    assert found["master"][0] == "ok"
    assert found["/odom"][:1] == ("ok",)
    assert found["/odom"][1].startswith("nav_msgs/Odometry, ")
    assert found["colour image"] == ("ok", "rgb8, 64x48", "")
    assert found["clocks"][0] == "ok"
    assert found["/discrete_move"][0] == "ok"
    assert found["response"][0] == found["slowest turn"][0] == "ok"
    assert found["Left 30°"][0] == found["Right 30°"][0] == "ok"
    # A camera without camera_info is only a warning.
    assert found["/camera/color/camera_info"][0] == "warning"


@pytest.mark.ros
@pytest.mark.parametrize(
    ("part", "word", "what", "health", "says"),
    [
        ("camera", "silent", "/camera/color/image_raw", "failed", "silent for"),
        pytest.param("camera", "blind", "/camera/depth/image_raw", "failed", "silent for", marks=pytest.mark.long),
        ("camera", "small", "depth image", "failed", "32x24; the profile has 64x48"),
        ("camera", "yuv", "colour image", "failed", "'yuv422'"),
        ("camera", "past", "delay", "failed", "too late for every observation"),
        ("base", "silent", "/odom", "failed", "silent for"),
    ],
)
def test_a_broken_part_is_named_with_what_to_do(patient, part, word, what, health, says) -> None:
    patient.probe.tell(f"/{part}/fault", word)
    code, found = patient.findings()
    assert code == 1
    assert found[what][0] == health
    assert says in found[what][1]
    assert found[what][2]


@pytest.mark.ros
@pytest.mark.long
def test_wheels_that_turn_for_nothing_are_noticed_when_they_may_move(patient) -> None:
    patient.probe.tell("/base/fault", "stuck")
    code, found = patient.findings("--move")
    assert code == 1
    assert found["Left 30°"][0] == "failed"
    assert "answered False" in found["Left 30°"][1]


@pytest.mark.ros
def test_a_wedged_server_is_noticed(patient) -> None:
    patient.server.signal(signal.SIGSTOP)
    code, found = patient.findings()
    assert code == 1
    assert "did not answer" in found["/discrete_move"][1]
    assert "vsnbench robots serve" in found["/discrete_move"][2]


@pytest.mark.ros
def test_a_profile_that_names_another_topic_or_type_is_noticed(patient, tmp_path) -> None:
    other = tmp_path / "other.yaml"
    text = PROFILE.read_text().replace("command: /cmd_vel", "command: /other/cmd_vel")
    other.write_text(text.replace("cliff: /mobile_base/events/cliff", "cliff: /mobile_base/events/bumper"))
    code, found = patient.findings(profile=other)
    assert code == 1
    assert found["/other/cmd_vel"][:2] == ("failed", "no base subscribes")


@pytest.mark.ros
@pytest.mark.long
def test_a_server_that_steers_another_topic_is_not_ready(tmp_path) -> None:
    with live_network(tmp_path) as network:
        network.start(HERE / "nodes" / "kinematic_base.py")
        network.start(HERE / "nodes" / "camera.py")
        network.wait_for_publisher("/odom")
        server = network.start(HERE / "nodes" / "upstream_like_server.py", "/cmd_vel:=/elsewhere")
        network.wait_for_service("/discrete_move")
        second = network.start(HERE / "nodes" / "camera.py", "__name:=second_camera")
        wait_until(
            lambda: len(network.master.state().publishers.get("/camera/color/image_raw", ())) == 2, "two cameras"
        )
        done = doctor("--robot", str(PROFILE), "--results", str(tmp_path), environment=network.environment)
        assert done.returncode == 1
        seen = " ".join(done.stdout.split())
        assert "velocities on /elsewhere, but the base subscribes to /cmd_vel" in seen
        assert "/camera and /second_camera both publish it" in seen
        server.end()
        second.end()


@pytest.mark.ros
def test_without_a_master_the_rest_is_not_looked_at(patient) -> None:
    environment = patient.network.environment | {"ROS_MASTER_URI": ""}
    done = doctor("--robot", str(PROFILE), "--results", str(patient.results), environment=environment)
    assert done.returncode == 1
    assert "ROS_MASTER_URI is not set" in done.stdout
    assert "/odom" not in done.stdout


@pytest.mark.parametrize("words", [(), ("--robot", "simulated")])
def test_without_a_real_robot_this_machine_alone_is_checked(typed: Typed, words: tuple[str, ...], tmp_path) -> None:
    done = typed("doctor", *words, "--results", str(tmp_path / "results"))
    assert done.code == 0, done.err
    assert "can be written" in done.out
    assert "ready: this machine" in done.out


def test_the_json_for_a_bug_report_has_versions_and_nothing_private(typed: Typed, tmp_path, monkeypatch) -> None:
    for name, value in (("HOME", str(tmp_path)), ("OPENAI_API_KEY", "sk-secret"), ("VSNBENCH_OPERATOR", "Ada")):
        monkeypatch.setenv(name, value)
    done = typed("doctor", "--json", "--results", str(tmp_path / "results"))
    report = json.loads(done.out)
    assert (report["ready"], report["robot"]) == (True, None)
    assert report["machine"]["vsnbench"] == __version__
    found = {check["what"]: check for check in report["checks"]}
    assert found["disk"]["seen"].startswith("~/results: ")
    for secret in (str(tmp_path), "sk-secret", "Ada", socket.gethostname(), getpass.getuser()):
        assert not re.search(rf"\b{re.escape(secret)}\b", done.out)


def test_move_without_a_robot_is_a_usage_error(typed: Typed, tmp_path) -> None:
    assert typed("doctor", "--move", "--results", str(tmp_path)).code == 2


def test_a_results_directory_that_cannot_be_written_is_named(typed: Typed, tmp_path, monkeypatch) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("HOME", str(tmp_path))
    done = typed("doctor", "--robot", "simulated", "--results", str(tmp_path / "file" / "results"))
    assert done.code == 1
    assert "cannot write the results directory ~/file/results" in " ".join(done.out.split())
