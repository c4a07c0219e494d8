"""The discrete_move node over a real master, on a base with faults: accurate, or False."""

import math
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import pytest

from tests.ros.ros1.network import HERE, PYTHON_OF_ROS1, Probe, Process, RosNetwork, live_network, wait_until
from vsnbench.ros.ros1.messages import DiscreteServer, DiscreteServerRequest
from vsnbench.ros.ros1.service_call import ServiceClient

pytestmark = pytest.mark.ros

PROFILE = HERE / "profile_of_test_base.yaml"
BASE = HERE / "nodes" / "kinematic_base.py"
PATIENCE_S = 40.0


def start_server(network: RosNetwork, *parameters: str) -> Process:
    server = network.start("-m", "vsnbench.cli.main", "robots", "serve", str(PROFILE), *parameters)
    network.wait_for_service("/discrete_move")
    return server


@dataclass
class Stand:
    """A base on the test stand, served by discrete_move."""

    network: RosNetwork
    probe: Probe
    server: Process
    base: Process

    def client(self) -> ServiceClient:
        return ServiceClient("/discrete_move", DiscreteServer, self.network.master)

    def ask(self, movement: str, angle: int = 0) -> bool:
        return bool(self.client().call(DiscreteServerRequest(movement, angle), PATIENCE_S).response)

    def ask_later(self, movement: str, angle: int = 0) -> "Future[bool]":
        """Request a movement from another thread, and return once the base truly moves."""
        pool = ThreadPoolExecutor(1)
        future = pool.submit(self.ask, movement, angle)
        pool.shutdown(wait=False)
        wait_until(lambda: self.probe.speed > 0.05 or future.done(), "the base moves")
        return future

    def fault(self, word: str) -> float:
        return self.probe.tell("/base/fault", word)

    def why(self) -> str:
        return self.server.output.rsplit("failed: ", 1)[-1].splitlines()[0]


@pytest.fixture(scope="module")
def shared_stand(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stand]:
    with live_network(tmp_path_factory.mktemp("ros")) as network:
        base = network.start(BASE, "_heading_deg:=137")
        network.wait_for_publisher("/odom")
        server = start_server(network)
        probe = Probe(network)
        try:
            wait_until(lambda: Stand(network, probe, server, base).ask("Stop"), "discrete_move answers")
            yield Stand(network, probe, server, base)
        finally:
            probe.close()


@pytest.fixture
def stand(shared_stand: Stand) -> Iterator[Stand]:
    """The shared stand, repaired after the test."""
    yield shared_stand
    for word in ("good", "release", "floor", "raise"):
        shared_stand.fault(word)
    began = time.monotonic()
    wait_until(lambda: shared_stand.probe.stopped_at(began), "the base stands still after the test")


def moved(stand: Stand, movement: str, angle: int = 0) -> tuple[float, float]:
    """Execute a movement and return the base's true motion: metres along its old heading, degrees."""
    (x0, y0), heading0 = stand.probe.position, stand.probe.heading_deg
    assert stand.ask(movement, angle) is True
    (x1, y1), heading1 = stand.probe.position, stand.probe.heading_deg
    along = (x1 - x0) * math.cos(math.radians(heading0)) + (y1 - y0) * math.sin(math.radians(heading0))
    return along, heading1 - heading0


@pytest.mark.parametrize(
    ("movement", "angle", "metres", "degrees"),
    [
        ("Forward", 0, 0.25, 0),
        ("Backward", 0, -0.25, 0),
        ("Left", 30, 0, 30),
        ("Right", 45, 0, -45),
        ("Left", 0, 0, 0),
    ],
)
def test_a_movement_meets_the_tolerances_of_the_paper(stand, movement, angle, metres, degrees) -> None:
    along, turned = moved(stand, movement, angle)
    assert along == pytest.approx(metres, abs=0.005)
    assert turned == pytest.approx(degrees, abs=0.1 if degrees else 1.0)


def test_turns_add_up_and_do_not_drift(stand) -> None:
    before = stand.probe.heading_deg
    for _ in range(6):
        assert stand.ask("Left", 30) is True
    assert stand.probe.heading_deg - before == pytest.approx(180, abs=0.2)


def test_stop_is_true_and_moves_nothing(stand) -> None:
    along, turned = moved(stand, "Stop")
    assert (along, turned) == (0.0, 0.0)


@pytest.mark.parametrize(("movement", "angle"), [("Jump", 0), ("forward", 0), ("", 0), ("Left", -30), ("Left", 400)])
def test_an_invalid_request_is_false_at_once_and_moves_nothing(stand, movement, angle) -> None:
    before = stand.probe.position
    assert stand.ask(movement, angle) is False
    assert stand.probe.position == before


@pytest.mark.parametrize(
    ("word", "reason"),
    [
        ("silent", "no odometry for"),
        ("nan", "odometry is not finite"),
        ("jump", "odometry jumped"),
        ("bumper", "bumper (centre)"),
        ("cliff", "cliff (left)"),
        ("drop", "wheel drop (left)"),
        ("stuck", "does not follow"),
    ],
)
def test_a_fault_during_a_movement_is_false_and_zero_velocity(stand, word, reason) -> None:
    answer = stand.ask_later("Left", 180)
    fault_s = stand.fault(word)
    assert answer.result(PATIENCE_S) is False
    assert reason in stand.why()
    wait_until(lambda: stand.probe.stopped_at(fault_s), "the base stands still")
    # "stuck" is detected after stall_s; the base does not move meanwhile.
    assert stand.probe.stopped_at(fault_s) - fault_s < 1.0


def test_a_pressed_bumper_allows_only_the_way_back(stand) -> None:
    stand.fault("bumper")
    wait_until(lambda: stand.ask("Forward") is False, "the bumper is detected")
    assert stand.ask("Forward") is False  # the first may have begun before the node heard of it
    assert "bumper sensor is active" in stand.why()
    wait_until(lambda: stand.ask("Backward") is True, "a busy machine lets the robot back off")


def test_a_lifted_robot_moves_only_after_it_is_put_down(stand) -> None:
    stand.fault("drop")
    wait_until(lambda: stand.ask("Left", 30) is False, "the wheel drop is detected")
    assert stand.ask("Left", 30) is False  # the first may have begun before the node heard of it
    assert "put the robot down" in stand.why()
    stand.fault("raise")
    wait_until(lambda: stand.ask("Left", 30) is True, "the wheels are raised")


def test_odometry_that_is_silent_before_the_movement_is_false_with_no_motion(stand) -> None:
    stand.fault("silent")
    wait_until(lambda: stand.ask("Forward") is False, "the silence is detected")
    assert "no odometry for" in stand.why()


def test_a_new_request_pre_empts_the_one_that_runs(stand) -> None:
    answer = stand.ask_later("Left", 180)
    stop_s = time.monotonic()
    assert stand.ask("Stop") is True
    assert answer.result(PATIENCE_S) is False
    assert "pre-empted by another movement: stop" in stand.why()
    wait_until(lambda: stand.probe.stopped_at(stop_s), "the base stands still")
    assert stand.probe.stopped_at(stop_s) - stop_s < 1.0


def test_the_movement_of_a_killed_caller_ends(stand) -> None:
    caller = subprocess.Popen(
        [*PYTHON_OF_ROS1, str(HERE / "nodes" / "caller.py"), "Left", "360"], env=stand.network.environment
    )
    wait_until(lambda: stand.probe.speed > 0.05, "the base moves")
    kill_s = time.monotonic()
    caller.kill()
    caller.wait()
    wait_until(lambda: stand.probe.stopped_at(kill_s), "the base stands still")
    assert stand.probe.stopped_at(kill_s) - kill_s < 2.0
    wait_until(lambda: "the caller has disconnected" in stand.server.output, "the reason is logged")


def test_a_base_turned_by_hand_turns_from_its_present_heading(stand) -> None:
    assert stand.ask("Left", 30) is True
    stand.network.start(HERE / "nodes" / "caller.py", "--push")
    before = stand.probe.heading_deg
    wait_until(lambda: abs(stand.probe.heading_deg - before) > 20, "the base is turned by hand")
    began = time.monotonic()
    wait_until(lambda: stand.probe.stopped_at(began), "the base stands still")
    _, turned = moved(stand, "Right", 30)
    assert turned == pytest.approx(-30, abs=0.1)


def test_a_plain_rospy_client_is_served(stand) -> None:
    plain = HERE / "nodes" / "caller.py"
    done = subprocess.run([*PYTHON_OF_ROS1, str(plain), "Forward", "0"], env=stand.network.environment, timeout=60)
    assert done.returncode == 0


def test_the_tools_of_ros_see_upstreams_service(stand) -> None:
    tools = shutil.which("rosservice", path=f"{sys.prefix}/bin:/usr/bin")
    shim = HERE.parents[2] / "vsnbench" / "ros" / "ros1" / "interfaces"
    environment = stand.network.environment
    environment["PYTHONPATH"] = f"{shim}:{environment['PYTHONPATH']}"

    def rosservice(*words: str) -> str:
        done = subprocess.run(
            [*PYTHON_OF_ROS1, tools, *words], env=environment, capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert "Type: discrete_move/DiscreteServer\nArgs: movement angle" in rosservice("info", "/discrete_move")
    before = stand.probe.heading_deg
    assert rosservice("call", "/discrete_move", "Left", "30").strip() == "response: True"
    assert stand.probe.heading_deg - before == pytest.approx(30, abs=0.1)


def test_a_second_server_for_the_same_robot_is_refused_and_names_the_first(stand) -> None:
    second = stand.network.start("-m", "vsnbench.cli.main", "robots", "serve", str(PROFILE))
    assert second.wait() == 1
    assert f"/discrete_move is already running on this robot (process {stand.server.popen.pid}" in second.output
    assert stand.ask("Stop") is True


def test_the_outcome_is_published_with_its_reason(stand) -> None:
    stand.probe.ask("listen", "/discrete_move/outcome")
    wait_until(
        lambda: (
            not stand.ask("Jump")
            and any("unknown movement" in w for w in stand.probe.ask("words", "/discrete_move/outcome"))
        ),
        "the outcome is published",
    )


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_server_that_is_ended_stops_the_base_first(tmp_path, number) -> None:
    with live_network(tmp_path) as network:
        base = network.start(BASE, "_command_timeout_s:=1000")
        network.wait_for_publisher("/odom")
        server = start_server(network)
        probe = Probe(network)
        stand = Stand(network, probe, server, base)
        try:
            answer = stand.ask_later("Left", 180)
            end_s = time.monotonic()
            server.signal(number)
            assert server.wait() == 0
            wait_until(lambda: probe.stopped_at(end_s), "the base stands still")
            assert probe.stopped_at(end_s) - end_s < 1.0
            assert answer.exception(PATIENCE_S) is not None or answer.result() is False
        finally:
            probe.close()


def test_parameters_come_from_file_and_server_and_unknown_names_are_errors(network, tmp_path) -> None:
    wrong = network.start("-m", "vsnbench.cli.main", "robots", "serve", str(PROFILE), "_timout_s:=5")
    assert wrong.wait() == 1
    assert "ROS parameter ~timout_s of discrete_move" in wrong.output
    file = tmp_path / "mine.yaml"
    file.write_text("turn_tolerance_deg: 0.1\nlinear_velocty_m_s: 0.2\n")
    wrong = network.start("-m", "vsnbench.cli.main", "robots", "serve", str(PROFILE), "--config", str(file))
    assert wrong.wait() == 1
    assert "mine.yaml:2: linear_velocty_m_s" in wrong.output


@pytest.mark.parametrize(("uri", "says"), [("", "ROS_MASTER_URI is not set"), ("http://127.0.0.1:1", "no ROS master")])
def test_without_a_master_the_node_ends_with_one_line(tmp_path, uri, says) -> None:
    network = RosNetwork(tmp_path)
    server = network.start("-m", "vsnbench.cli.main", "robots", "serve", str(PROFILE), ROS_MASTER_URI=uri)
    assert server.wait() == 1
    assert says in server.output
    assert server.output.count("\n") == 1


@pytest.mark.long
def test_a_base_with_noise_at_rest_moves_accurately(tmp_path) -> None:
    with live_network(tmp_path) as network:
        base = network.start(BASE, "_noise_deg:=0.05", "_noise_m:=0.002")
        network.wait_for_publisher("/odom")
        stand = Stand(network, Probe(network), start_server(network), base)
        try:
            held_deg = stand.probe.heading_deg
            for number, word in enumerate(["Left", "Forward", "Right", "Backward", "Left"] * 2):
                before = stand.probe.position
                assert stand.ask(word, 30) is True, stand.why()
                if number % 5 in (0, 2, 4):
                    held_deg += 30 if word == "Left" else -30
                    assert math.remainder(stand.probe.heading_deg - held_deg, 360) == pytest.approx(0, abs=0.1)
                else:
                    assert math.dist(before, stand.probe.position) == pytest.approx(0.25, abs=0.005)
        finally:
            stand.probe.close()
