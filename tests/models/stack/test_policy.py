"""A stack as a model: a real HTTP server or a real program, without a robot."""

import json
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from tests.models.looks import look
from tests.processes import wait_until
from vsnbench.errors import ModelError, ModelLostError, VsnbenchError
from vsnbench.models.stack.policy import StackPolicy
from vsnbench.models.task import task_of
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.values.goal import Goal
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose

RULES = ProtocolParameters().driven_by_stack()


@dataclass
class Server:
    """The HTTP side of a stack."""

    status: int = 200
    body: bytes = b'{"arrived": false}'
    waits_s: float = 0.0
    endless: bool = False
    received: list[tuple[str, bytes]] = field(default_factory=list)
    address: str = ""


@pytest.fixture
def server() -> Iterator[Server]:
    state = Server()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            state.received.append((self.path, self.rfile.read(int(self.headers.get("Content-Length", 0)))))
            self.send_response(204)
            self.end_headers()

        def do_GET(self) -> None:
            time.sleep(state.waits_s)
            self.send_response(state.status)
            self.send_header("Content-Length", str(10 * 2**30 if state.endless else len(state.body)))
            self.end_headers()
            try:
                while state.endless:
                    self.wfile.write(bytes(2**16))
                self.wfile.write(state.body)
            except OSError:  # the client has read enough
                pass

        def log_message(self, *_: object) -> None:
            pass

    http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    http.daemon_threads = True
    state.address = f"http://127.0.0.1:{http.server_port}"
    threading.Thread(target=http.serve_forever, daemon=True).start()
    yield state
    http.shutdown()


def stack(directory: Path, ways: str, **begun: ProtocolParameters) -> StackPolicy:
    """Return a stack with these lines in its file, which has begun an episode."""
    file = directory / "stack.yaml"
    file.write_text(f'name: theirs\nversion: "2"\ncommit: 8f0c2d1\ntimeout_s: 1\n{ways}\n')
    policy = StackPolicy(file)
    policy.begin(task_of(Goal("chair"), 0, begun.get("rules", RULES), load_profile("turtlebot2")))
    return policy


def http_ways(server: Server) -> str:
    goal, state, abort = (f"{{http: '{server.address}/{name}'}}" for name in ("goal", "state", "abort"))
    return f"announce: {goal}\narrived: {state}\nabort: {abort}"


def ends(policy: StackPolicy, patience_s: float = 20.0) -> str:
    """Return the source of the stack's STOP."""
    found = []

    def has_stopped() -> bool:
        decision = policy.act(look())
        found.append(decision)
        return decision.action is Action.STOP

    wait_until(has_stopped, "the stack arrives", patience_s)
    return found[-1].raw_action


def test_a_server_is_told_the_goal_and_asked_until_it_has_arrived(server: Server, tmp_path: Path) -> None:
    policy = stack(tmp_path, http_ways(server))
    assert policy.act(look()).action is Action.NOOP
    wait_until(lambda: server.received, "the goal arrives")
    path, body = server.received[0]
    assert (path, json.loads(body)["goal"], json.loads(body)["kind"]) == ("/goal", "chair", "category")
    server.body = b'{"arrived": true}'
    assert ends(policy) == "declared"
    policy.end_episode()
    policy.close()
    assert [path for path, _ in server.received] == ["/goal", "/abort"]


@pytest.mark.parametrize(
    ("faults", "kind", "says"),
    [
        ({"status": 500}, ModelError, "500"),
        ({"waits_s": 30.0}, ModelLostError, "did not answer"),
        ({"endless": True}, ModelError, "more than 65,536 bytes"),
        ({"body": b"<html>"}, ModelError, "not JSON"),
        ({"body": b"[]"}, ModelError, "not a JSON object"),
        ({"body": b'{"arrived": "yes"}'}, ModelError, "true or false"),
        ({"body": b'{"arrived": false, "failed": "no path"}'}, ModelError, "no path"),
    ],
)
def test_an_answer_that_cannot_be_used_is_one_line(
    server: Server, tmp_path: Path, faults: dict[str, object], kind: type[VsnbenchError], says: str
) -> None:
    for name, value in faults.items():
        setattr(server, name, value)
    policy = stack(tmp_path, http_ways(server))
    with pytest.raises(kind, match=says) as caught:
        ends(policy)
    assert "\n" not in str(caught.value)
    policy.close()


@pytest.mark.parametrize(("code", "outcome"), [(0, "declared"), (3, "exit code 3")])
def test_the_exit_code_of_a_command_says_whether_it_has_arrived(tmp_path: Path, code: int, outcome: str) -> None:
    program = f"import sys; open('goal', 'w').write(sys.argv[1]); sys.exit({code})"
    command = json.dumps([sys.executable, "-c", program, "{goal}"])
    policy = stack(tmp_path, f"announce: {{command: {command}}}\narrived: {{exit_code: 0}}")
    if code == 0:
        assert ends(policy) == outcome
    else:
        with pytest.raises(ModelError, match=outcome):
            ends(policy)
    assert (tmp_path / "goal").read_text() == "chair"
    policy.close()


def test_a_command_that_runs_on_is_ended_with_the_episode(tmp_path: Path) -> None:
    command = json.dumps([sys.executable, "-c", "import time; open('up', 'w').close(); time.sleep(600)"])
    policy = stack(tmp_path, f"announce: {{command: {command}}}\narrived: {{exit_code: 0}}")
    policy.act(look())
    wait_until((tmp_path / "up").exists, "the program runs")
    process = policy._trial._process
    policy.end_episode()
    policy.close()
    assert process.poll() is not None


def test_a_program_that_does_not_exist_is_named(tmp_path: Path) -> None:
    policy = stack(tmp_path, "announce: {command: [./no-such-program]}\narrived: {exit_code: 0}")
    with pytest.raises(ModelError, match="no-such-program"):
        ends(policy)


def test_rest_counts_only_after_the_robot_has_moved(tmp_path: Path) -> None:
    policy = stack(tmp_path, "announce: {operator: 'start with {goal}'}\narrived: {rest_s: 2}")
    assert policy.announcement == "start with chair"
    course = [(second, 0.0) for second in range(10)] + [(10, 0.5), (11, 0.5), (12, 0.5)]
    looks = [replace(look(Pose(x_m, 0.0)), stamp_s=float(second)) for second, x_m in course]
    stopped = [seen.stamp_s for seen in looks if policy.act(seen).action is Action.STOP]
    assert stopped == [12.0]


def test_a_stack_is_not_announced_where_nobody_would_stop_it(server: Server, tmp_path: Path) -> None:
    with pytest.raises(ModelError) as caught:
        stack(tmp_path, http_ways(server), rules=ProtocolParameters())
    assert caught.value.code == "stack-not-watched"
    assert not server.received


def test_a_stack_is_identified_by_its_version_and_file(server: Server, tmp_path: Path) -> None:
    first = stack(tmp_path, http_ways(server)).card
    second = stack(tmp_path, f"{http_ways(server)}\ngoals: [chair]").card
    assert (first.code, first.weights_label) == ({"version": "2", "commit": "8f0c2d1"}, "version 2")
    assert first.identity != second.identity
