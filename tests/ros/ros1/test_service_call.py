"""A service call ends within its deadline, whatever happens to server, master and network."""

import signal
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest

from tests.processes import Process, wait_until
from tests.ros.ros1.network import RosNetwork, live_network
from vsnbench.ros.ros1.master import Master, MasterError
from vsnbench.ros.ros1.messages import DiscreteServer, DiscreteServerRequest, PlaceRobot, PlaceRobotRequest
from vsnbench.ros.ros1.service_call import REFUSED, TIMEOUT, UNAVAILABLE, ServiceClient, ServiceError

pytestmark = pytest.mark.ros

ECHO = Path(__file__).parent / "nodes" / "echo_server.py"


class Echo:
    """A server of discrete_move on its own network."""

    def __init__(self, network: RosNetwork) -> None:
        self.network = network
        self._start()

    def _start(self) -> None:
        self.process: Process = self.network.start(ECHO)
        # The master knows a killed server until another one replaces it.
        wait_until(self._answers, "the server answers")

    def _answers(self) -> bool:
        try:
            return ServiceClient("/discrete_move", DiscreteServer, self.network.master).probe() < 2.0
        except ServiceError:
            return False

    def make_good(self) -> None:
        self.process.signal(signal.SIGCONT)  # does nothing to a process that has ended
        if not self._answers():
            self.process.wait()
            self._start()


@pytest.fixture(scope="module")
def shared_echo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Echo]:
    with live_network(tmp_path_factory.mktemp("ros")) as network:
        yield Echo(network)


@pytest.fixture
def echo(shared_echo: Echo) -> Echo:
    """The shared server, which runs."""
    shared_echo.make_good()
    return shared_echo


@pytest.fixture
def server(echo: Echo) -> Process:
    return echo.process


@pytest.fixture
def client(echo: Echo) -> ServiceClient:
    return ServiceClient("/discrete_move", DiscreteServer, echo.network.master)


@contextmanager
def failing(code: str, match: str = "") -> Iterator[None]:
    """Expect a service error of a kind."""
    with pytest.raises(ServiceError, match=match) as raised:
        yield
    assert raised.value.code == code


def ask(client: ServiceClient, movement: str = "Forward", angle: int = 0, timeout_s: float = 20.0, watch=None) -> bool:
    return bool(client.call(DiscreteServerRequest(movement, angle), timeout_s, watch).response)


def test_a_live_server_answers(client) -> None:
    assert ask(client) is True
    assert ask(client, "No") is False
    assert client.probe() < 2.0


def test_the_watch_is_called_while_waiting_for_a_slow_answer(client) -> None:
    looks: list[float] = []
    assert ask(client, "Sleep", 400, watch=lambda: looks.append(time.monotonic())) is True
    assert len(looks) >= 2


def test_an_exception_of_the_watch_ends_the_call(client) -> None:
    def alarm() -> None:
        raise KeyboardInterrupt

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        ask(client, "Sleep", 15_000, watch=alarm)
    assert time.monotonic() - began < 5


def test_an_answer_after_the_deadline_is_a_timeout(client) -> None:
    began = time.monotonic()
    with failing(TIMEOUT, match=r"within 0\.5 s \(answer\)"):
        ask(client, "Sleep", 20_000, timeout_s=0.5)
    assert time.monotonic() - began < 5


def test_a_hanging_server_is_detected_long_before_the_deadline(client, server) -> None:
    assert ask(client) is True
    server.signal(signal.SIGSTOP)
    stopped = psutil.Process(server.popen.pid)
    wait_until(lambda: stopped.status() == psutil.STATUS_STOPPED, "the server is stopped")
    began = time.monotonic()
    with failing(TIMEOUT):
        ask(client, timeout_s=60)
    assert time.monotonic() - began < 10
    server.signal(signal.SIGCONT)
    assert ask(client) is True


def test_a_server_killed_before_the_call_is_unavailable(client, server) -> None:
    assert ask(client) is True
    server.signal(signal.SIGKILL)
    server.wait()
    with failing(UNAVAILABLE):
        ask(client)


def test_a_server_that_dies_during_the_call_is_detected_at_once(client) -> None:
    began = time.monotonic()
    with failing(UNAVAILABLE, match="closed the connection"):
        ask(client, "Die", timeout_s=60)
    assert time.monotonic() - began < 10


def test_a_restarted_server_is_found_again(client, echo) -> None:
    assert ask(client) is True
    echo.process.signal(signal.SIGKILL)
    echo.process.wait()
    echo.make_good()
    assert ask(client) is True


def test_a_hanging_master_is_detected(echo) -> None:
    network = echo.network
    network.roscore.signal(signal.SIGSTOP)
    try:
        began = time.monotonic()
        with pytest.raises(MasterError):
            Master(network.uri, timeout_s=0.5).pid()
        assert time.monotonic() - began < 5
    finally:
        network.roscore.signal(signal.SIGCONT)


def test_a_handler_that_fails_is_refused_with_its_reason(client) -> None:
    with failing(REFUSED, match="the wheels came off"):
        ask(client, "Raise")


def test_another_service_type_is_refused_with_its_reason(echo) -> None:
    wrong = ServiceClient("/discrete_move", PlaceRobot, echo.network.master)
    with failing(REFUSED, match="md5sum"):
        wrong.call(PlaceRobotRequest(), 10)
    with failing(REFUSED, match="md5sum"):
        wrong.probe()


def test_a_service_without_a_server_is_unavailable(echo) -> None:
    with failing(UNAVAILABLE, match="/nowhere"):
        ServiceClient("/nowhere", DiscreteServer, echo.network.master).call(DiscreteServerRequest(), 5)


class FixedMaster(Master):
    """A master with a service whose address belongs to another program."""

    def service_uri(self, name: str) -> str:
        return self.uri


@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (b"", TIMEOUT),
        (b"\xff\xff\xff\x7f", UNAVAILABLE),
        (b"\x00\x00\x00\x00\x01\x05", TIMEOUT),
    ],
    ids=["silence", "absurd length", "half an answer"],
)
def test_an_invalid_answer_ends_the_call_in_time(answer: bytes, error) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        held: list[socket.socket] = []

        def serve() -> None:
            connection, _ = listener.accept()
            held.append(connection)
            connection.sendall(answer)

        thread = threading.Thread(target=serve)
        thread.start()
        uri = f"rosrpc://127.0.0.1:{listener.getsockname()[1]}"
        began = time.monotonic()
        with failing(error):
            ServiceClient("/x", DiscreteServer, FixedMaster(uri)).call(DiscreteServerRequest(), 0.5)
        assert time.monotonic() - began < 5
        thread.join()
        held[0].close()


def test_many_calls_leave_no_thread_and_no_descriptor_behind(client) -> None:
    def descriptors() -> int:
        return psutil.Process().num_fds()

    ask(client)
    before, threads = descriptors(), threading.active_count()
    for _ in range(100):
        ask(client)
    assert descriptors() == before
    assert threading.active_count() == threads


def test_a_dead_master_is_no_obstacle_to_a_known_server_but_named_by_a_new_client(client, echo) -> None:
    """Must be the last test of this network: a server is not registered at another master."""
    client.locate()
    echo.network.roscore.signal(signal.SIGKILL)
    echo.network.roscore.wait()
    assert ask(client) is True
    with pytest.raises(MasterError, match=echo.network.uri):
        ask(ServiceClient("/discrete_move", DiscreteServer, echo.network.master))
