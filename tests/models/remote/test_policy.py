"""A policy in another process behaves like a local one, and survives faults of its server."""

import http.server
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.sync.server import ServerConnection

from tests.models.remote.servers import (
    CARD,
    PATIENCE_S,
    STUB,
    free_port,
    look,
    scripted_server,
    stub_server,
)
from vsnbench.errors import ModelError, ModelLostError, UsageError
from vsnbench.models.registry import create_policy
from vsnbench.models.remote.connection import Connection
from vsnbench.models.remote.peer import MAX_ANSWER_BYTES, Address, ModelBusyError
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.vsnbench_policy import pack
from vsnbench.values.movement import Action
from vsnbench.values.observation import Sensor

REPEATS = """
import numpy as np

class Model:
    card = {"name": "repeats", "sensors": ["rgb", "depth", "odometry"], "weights_sha256": "ab12"}

    def reset(self, goal, seed):
        if goal == "toilet":
            raise ValueError("never heard of a toilet")
        self.goal, self.seed = goal, seed

    def act(self, observation):
        depth_m = observation.depth_m
        return {
            "action": "TURN_LEFT",
            "raw_action": "LOOK_UP",
            "probabilities": {"TURN_LEFT": 0.75},
            "diagnostics": {
                "scalars": {
                    "red": float(observation.rgb[..., 0].sum()),
                    "green": float(observation.rgb[..., 1].sum()),
                    "holes": float(np.isnan(depth_m).sum()),
                    "depth": float(np.nansum(depth_m, dtype=np.float64)),
                },
                "sub_goal": [observation.pose.x_m, observation.pose.y_m],
                "note": self.goal,
                "details": {"seed": self.seed, "width": observation.camera.width, "stamp": observation.stamp_s},
            },
        }
"""
SLOW = """
import time

class Model:
    card = {"name": "slow", "sensors": []}

    def reset(self, goal, seed):
        self.seed = seed

    def act(self, observation):
        time.sleep(self.seed / 10)
        return "STOP"
"""


@pytest.fixture
def repeats(tmp_path: Path) -> Iterator[str]:
    with stub_server(REPEATS, tmp_path) as (url, _):
        yield url


def test_what_the_model_sees_is_what_the_robot_saw_and_its_answer_comes_back_whole(repeats: str) -> None:
    policy = create_policy(repeats)
    assert policy.card.name == "repeats"
    assert policy.card.weights_sha256 == "ab12"
    assert policy.card.sensors == {Sensor.RGB, Sensor.DEPTH, Sensor.ODOMETRY}
    seen = look()
    assert seen.depth_m is not None
    policy.reset("chair", 4_000_000_000)
    decision = policy.act(seen)
    assert (decision.action, decision.raw_action) == (Action.TURN_LEFT, "LOOK_UP")
    shown = decision.diagnostics
    assert shown.probabilities == {"TURN_LEFT": 0.75}
    assert shown.scalars["red"] == seen.rgb[..., 0].sum()
    assert shown.scalars["green"] == seen.rgb[..., 1].sum()
    assert shown.scalars["holes"] == np.isnan(seen.depth_m).sum()
    assert shown.scalars["depth"] == np.nansum(seen.depth_m, dtype=np.float64)
    assert shown.sub_goal == (1.0, -0.5)
    assert shown.note == "chair"
    wire = shown.details["wire"]
    assert {name: value for name, value in shown.details.items() if name != "wire"} == {
        "seed": 4_000_000_000,
        "width": 64,
        "stamp": 12.5,
    }
    assert wire["sent_bytes"] > seen.rgb.nbytes + seen.depth_m.nbytes
    assert 0 < wire["infer_s"] < wire["round_trip_s"]
    assert wire["received_bytes"] > 0


def test_depth_in_millimetres_is_half_the_bytes_and_another_condition(repeats: str, tmp_path: Path) -> None:
    (tmp_path / "wire.yaml").write_text("depth: mm16\n")
    policy = create_policy(repeats, model_config=tmp_path / "wire.yaml")
    assert policy.card.settings == {"wire_depth": "mm16"}
    seen = look()
    assert seen.depth_m is not None
    policy.reset("chair", 0)
    scalars = policy.act(seen).diagnostics.scalars
    assert scalars["holes"] == np.isnan(seen.depth_m).sum()
    assert abs(scalars["depth"] - float(np.nansum(seen.depth_m))) < 0.0005 * seen.depth_m.size


def test_jpeg_is_sent_where_the_settings_ask_for_it(repeats: str, tmp_path: Path) -> None:
    (tmp_path / "wire.yaml").write_text("rgb: jpeg\n")
    policy = create_policy(repeats, model_config=tmp_path / "wire.yaml")
    seen = look()
    policy.reset("chair", 0)
    red = policy.act(seen).diagnostics.scalars["red"]
    assert abs(red / float(seen.rgb[..., 0].sum()) - 1) < 0.05


def test_the_models_own_exception_is_its_error_and_the_conversation_goes_on(repeats: str) -> None:
    policy = create_policy(repeats)
    with pytest.raises(ModelError, match="never heard of a toilet") as failed:
        policy.reset("toilet", 0)
    assert "served_model.py" in "".join(failed.value.__notes__)
    policy.reset("chair", 0)
    assert policy.act(look()).action is Action.TURN_LEFT


def acted(policy: RemotePolicy) -> RemotePolicy:
    """Return a policy whose connection has answered an action, so that the next one has the limit for actions."""
    policy.reset("chair", 0)
    policy.act(look())
    return policy


COMPILES = """
import time

class Model:
    card = {"name": "compiles", "sensors": []}
    compiled = False

    def reset(self, goal, seed):
        self.seed = seed

    def act(self, observation):
        time.sleep(self.seed / 10 if self.compiled else 1.5)
        self.compiled = True
        return "STOP"
"""


def test_the_first_action_of_a_connection_has_the_time_of_reset(tmp_path: Path) -> None:
    with stub_server(COMPILES, tmp_path) as (url, _):
        policy = RemotePolicy(url, act_timeout=0.5)
        policy.reset("chair", 0)
        decision = policy.act(look())
        assert decision.action is Action.STOP
        assert decision.diagnostics.details["wire"]["act_timeout_s"] == policy.settings.reset_timeout_s
        assert policy.act(look()).diagnostics.details["wire"]["act_timeout_s"] == 0.5
        policy.reset("chair", 20)
        with pytest.raises(ModelLostError, match=r"within 0\.5 s"):
            policy.act(look())


def test_a_first_action_beyond_the_time_of_reset_is_lost(tmp_path: Path) -> None:
    (tmp_path / "settings.yaml").write_text("act_timeout_s: 0.2\nreset_timeout_s: 0.5\n")
    with stub_server(COMPILES, tmp_path) as (url, _):
        policy = RemotePolicy(url, tmp_path / "settings.yaml")
        policy.reset("chair", 0)
        with pytest.raises(ModelLostError, match=r"within 0\.5 s"):
            policy.act(look())


def test_a_model_that_answers_too_late_is_lost_and_its_answer_is_never_taken(tmp_path: Path) -> None:
    with stub_server(SLOW, tmp_path) as (url, _):
        policy = acted(RemotePolicy(url, act_timeout=0.5))
        policy.reset("chair", 50)
        began = time.monotonic()
        with pytest.raises(ModelLostError, match=r"within 0\.5 s"):
            policy.act(look())
        assert time.monotonic() - began < 4.5  # the server answers after 5 s
        policy.reset("chair", 1)  # the server is still busy with the old question, so the client waits
        assert policy.act(look()).action is Action.STOP


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_server_that_dies_or_stops_in_mid_act_is_lost(number: signal.Signals, tmp_path: Path) -> None:
    with stub_server(SLOW, tmp_path) as (url, process):
        policy = acted(RemotePolicy(url, act_timeout=1.0))
        policy.reset("chair", 50)
        threading.Timer(0.3, process.send_signal, [number]).start()
        began = time.monotonic()
        with pytest.raises(ModelLostError):
            policy.act(look(640, 480))
        assert time.monotonic() - began < 4.5  # the server would have answered after 5 s


def test_a_stopped_server_that_reads_nothing_does_not_hold_the_sender(tmp_path: Path) -> None:
    with stub_server(REPEATS, tmp_path) as (url, process):
        policy = acted(RemotePolicy(url, act_timeout=0.5))
        policy.reset("chair", 0)
        large = look(2048, 2048)
        process.send_signal(signal.SIGSTOP)
        began = time.monotonic()
        with pytest.raises(ModelLostError):
            policy.act(large)
        assert time.monotonic() - began < PATIENCE_S  # and not as long as the server is stopped


def test_the_next_episode_finds_a_server_that_was_restarted(tmp_path: Path) -> None:
    port = free_port()
    with stub_server(REPEATS, tmp_path, port=port) as (url, _):
        policy = RemotePolicy(url)
        policy.reset("chair", 0)
    with pytest.raises(ModelLostError):
        policy.act(look())
    with stub_server(REPEATS, tmp_path, port=port):
        policy.reset("chair", 0)
        assert policy.act(look()).action is Action.TURN_LEFT


def test_a_server_restarted_with_other_weights_is_refused(tmp_path: Path) -> None:
    port = free_port()
    with stub_server(REPEATS, tmp_path, port=port) as (url, _):
        policy = RemotePolicy(url)
        policy.reset("chair", 0)
    with pytest.raises(ModelLostError):
        policy.act(look())
    changed = REPEATS.replace("ab12", "cd34")
    with (
        stub_server(changed, tmp_path, port=port),
        pytest.raises(ModelLostError, match=r"ab12.*cd34") as refused,
    ):
        policy.reset("chair", 0)
    assert refused.value.code == "other-model"


def test_a_server_that_is_gone_is_said_to_be_lost_after_the_patience(tmp_path: Path) -> None:
    (tmp_path / "wire.yaml").write_text("patience_s: 0.2\n")
    with stub_server(REPEATS, tmp_path) as (url, _):
        policy = RemotePolicy(url, model_config=tmp_path / "wire.yaml")
        policy.reset("chair", 0)
    with pytest.raises(ModelLostError):
        policy.act(look())
    with pytest.raises(ModelLostError) as lost:
        policy.reset("chair", 0)
    assert lost.value.code == "no-server"


# Answers of a server, each to a question in a running episode.


def ready(connection: ServerConnection, message: dict[str, Any]) -> bool:
    if message["type"] == "reset":
        connection.send(pack({"type": "ready", "seq": message["seq"]}))
        return True
    return False


def decision(message: dict[str, Any], **others: Any) -> dict[str, Any]:
    return {"type": "decision", "seq": message["seq"], "action": "STOP", "seconds": 0.0, **others}


WRONG = {
    "an action that does not exist": (lambda m: decision(m, action="FLY"), "action"),
    "NaN as a probability": (lambda m: decision(m, probabilities={"STOP": float("nan")}), "probabilit"),
    "boxes that are none": (lambda m: decision(m, diagnostics={"boxes": [[1, 2]]}), "box"),
    "a sub-goal at infinity": (lambda m: decision(m, diagnostics={"sub_goal": [1e999, 0.0]}), "sub_goal"),
    "a number as a note": (lambda m: decision(m, diagnostics={"note": 17}), "note"),
    "diagnostics that are no map": (lambda m: decision(m, diagnostics=[1]), "diagnostics"),
    "another kind of message": (lambda m: {"type": "ready", "seq": m["seq"]}, "instead of decision"),
    "a question that was not asked": (lambda m: decision({"seq": m["seq"] + 5}), "not sent"),
    "no number": (lambda m: {"type": "decision", "action": "STOP"}, "not sent"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_decision_is_the_models_error(case: str) -> None:
    make, words = WRONG[case]

    def answer(connection: ServerConnection, message: dict[str, Any]) -> None:
        if not ready(connection, message):
            connection.send(pack(make(message)))

    with scripted_server(answer) as url:
        policy = RemotePolicy(url)
        policy.reset("chair", 0)
        with pytest.raises(ModelError, match=words):
            policy.act(look())


@pytest.mark.parametrize("content", [b"\xc1", b"\x80", b"\xc7\x01\x05\x00", "text", b"\xdf" + b"\xff" * 4, b""])
def test_bytes_that_are_no_message_are_the_models_error(content: bytes | str) -> None:
    def answer(connection: ServerConnection, message: dict[str, Any]) -> None:
        if not ready(connection, message):
            connection.send(content)

    with scripted_server(answer) as url:
        policy = RemotePolicy(url)
        policy.reset("chair", 0)
        with pytest.raises(ModelError) as refused:
            policy.act(look())
        assert refused.value.code == "invalid-message"


def test_an_answer_given_twice_is_taken_once() -> None:
    def answer(connection: ServerConnection, message: dict[str, Any]) -> None:
        if not ready(connection, message):
            turned = decision(message, action="TURN_LEFT" if message["seq"] == 2 else "TURN_RIGHT")
            connection.send(pack(turned))
            connection.send(pack(turned))

    with scripted_server(answer) as url:
        policy = RemotePolicy(url)
        policy.reset("chair", 0)
        assert [policy.act(look()).action for _ in range(3)] == [Action.TURN_LEFT, Action.TURN_RIGHT, Action.TURN_RIGHT]


@pytest.mark.parametrize("size", [(64, 48), (640, 480)])
def test_answers_that_come_before_their_questions_are_not_carried_out(size: tuple[int, int]) -> None:
    """The pong shows that the client has received all that was sent before the ping."""
    received = threading.Event()

    def answer(connection: ServerConnection, message: dict[str, Any]) -> None:
        if ready(connection, message):
            for number in range(message["seq"] + 1, message["seq"] + 11):
                connection.send(pack(decision({"seq": number}, action="MOVE_FORWARD")))
            pong = connection.ping()
            threading.Thread(target=lambda: pong.wait(PATIENCE_S) and received.set(), daemon=True).start()

    with scripted_server(answer) as url:
        policy = RemotePolicy(url)
        policy.reset("chair", 0)
        assert received.wait(PATIENCE_S)
        with pytest.raises(ModelError, match="request 2 before it was sent") as refused:
            policy.act(look(*size))
        assert "\n" not in str(refused.value)
        with pytest.raises(ModelLostError):
            policy.act(look(*size))


def test_an_answer_of_a_gigabyte_is_cut_off_early() -> None:
    def answer(connection: ServerConnection, message: dict[str, Any]) -> None:
        if not ready(connection, message):
            piece = bytes(1 << 20)
            connection.send(piece for _ in range(1024))

    with scripted_server(answer) as url:
        policy = RemotePolicy(url)
        policy.reset("chair", 0)
        with pytest.raises(ModelLostError) as lost:
            policy.act(look())
        assert lost.value.code == "connection-lost"
    assert MAX_ANSWER_BYTES < 1 << 24


@pytest.mark.parametrize(
    ("greeting", "code"),
    [
        ({"type": "card", "wire": 99, "card": CARD}, "wrong-protocol-version"),
        ({"type": "card", "wire": 1, "card": CARD}, "wrong-protocol-version"),
        ({"type": "card", "wire": 2, "card": {**CARD, "name": ""}}, "invalid-card"),
        ({"type": "card", "wire": 2, "card": {**CARD, "sensors": ["instances"]}}, "invalid-card"),
        ({"type": "card", "wire": 2, "card": {**CARD, "goals": [1]}}, "invalid-card"),
        ({"type": "card", "wire": 2, "card": {**CARD, "action_kinds": ["fly"]}}, "invalid-card"),
        ({"type": "card", "wire": 2, "card": {**CARD, "goal_kinds": []}}, "invalid-card"),
        ({"type": "card", "wire": 2, "card": {**CARD, "runs_on": [1]}}, "invalid-card"),
        ({"type": "card", "wire": 2, "card": {**CARD, "code": {"class": []}}}, "invalid-card"),
        ({"type": "card", "wire": 2}, "invalid-card"),
        ({"type": "error", "code": "busy", "message": "another client"}, "model-busy"),
        (b"\xc1", "invalid-message"),
    ],
)
def test_an_invalid_greeting_is_refused_in_one_line(greeting: dict[str, Any] | bytes, code: str) -> None:
    with (
        scripted_server(lambda connection, message: None, greeting) as url,
        pytest.raises(ModelError) as refused,
    ):
        RemotePolicy(url)
    assert refused.value.code == code
    assert "\n" not in str(refused.value)


ESCAPES = "\x1b]0;owned\x07\x9b2J\n"


def test_no_control_character_of_a_server_comes_in() -> None:
    def answer(connection: ServerConnection, message: dict[str, Any]) -> None:
        if not ready(connection, message):
            refusal = {"type": "error", "seq": message["seq"], "code": "model"}
            connection.send(pack({**refusal, "message": ESCAPES, "traceback": ESCAPES}))

    card = {**CARD, "name": f"a{ESCAPES}", "weights_label": ESCAPES, "runs_on": {"host": ESCAPES}}
    with scripted_server(answer, {"type": "card", "wire": 2, "card": card, "jpeg": False}) as url:
        policy = RemotePolicy(url)
        policy.reset("chair", 0)
        with pytest.raises(ModelError) as failed:
            policy.act(look())
        texts = [policy.card.name, policy.card.weights_label, *policy.card.runs_on.values(), str(failed.value)]
    assert all(str(text).isprintable() for text in texts)
    assert not set("\x1b\x07\x9b") & set("".join(failed.value.__notes__))


def test_a_wrong_token_is_refused_and_the_right_one_is_not(tmp_path: Path) -> None:
    with stub_server(SLOW, tmp_path, token="open sesame") as (url, _):
        with pytest.raises(ModelError) as refused:
            RemotePolicy(url, token="abracadabra")
        assert refused.value.code == "wrong-token"
        RemotePolicy(url, token="open sesame").close()


def test_one_client_has_the_model_at_a_time(tmp_path: Path) -> None:
    with stub_server(SLOW, tmp_path) as (url, _):
        first = RemotePolicy(url)
        with pytest.raises(ModelBusyError):
            RemotePolicy(url)
        first.close()


def test_a_client_that_is_just_leaving_is_waited_for(tmp_path: Path) -> None:
    with stub_server(SLOW, tmp_path) as (url, _):
        first = RemotePolicy(url)
        leaves = threading.Timer(0.2, first.close)
        leaves.start()
        RemotePolicy(url).close()
        leaves.join()


def test_a_port_where_something_else_listens_is_named_for_it() -> None:
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), http.server.BaseHTTPRequestHandler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with pytest.raises(ModelError) as refused:
            RemotePolicy(f"ws://127.0.0.1:{server.server_port}")
        assert refused.value.code == "not-a-model-server"
        server.shutdown()


def test_a_server_that_goes_while_the_hand_is_held_out_is_lost(tmp_path: Path) -> None:
    path = tmp_path / "model.sock"
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)  # the reading thread often detects the end before the first message is sent
    try:
        for _ in range(40):
            path.unlink(missing_ok=True)
            with socket.socket(socket.AF_UNIX) as listener:
                listener.bind(str(path))
                listener.listen(1)
                ends = threading.Thread(target=lambda one=listener: (select.select([one], [], [], 10), one.close()))
                ends.start()
                with pytest.raises(ModelLostError) as lost:
                    Connection(Address("ws://model:1", unix_path=str(path)), "", "test")
                assert lost.value.code in ("not-a-model-server", "no-server")
                ends.join()
    finally:
        sys.setswitchinterval(before)


@pytest.mark.parametrize(
    ("url", "code"),
    [
        ("ws://127.0.0.1", "invalid-address"),
        ("ws://:8765", "invalid-address"),
        ("ws://gpu-box:99999", "invalid-address"),
        ("ws://gpu-box:8765", "no-token"),
        ("ws://me:secret@127.0.0.1:8765", "invalid-address"),
    ],
)
def test_an_invalid_address_is_refused(url: str, code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("VSNBENCH_TOKEN", raising=False)
    with pytest.raises(UsageError) as refused:
        RemotePolicy(url)
    assert refused.value.code == code
    assert "secret" not in str(refused.value)


def test_where_nobody_listens_the_line_says_how_to_start_a_server() -> None:
    with pytest.raises(ModelLostError, match="vsnbench models serve"):
        RemotePolicy(f"ws://127.0.0.1:{free_port()}")


def test_the_stub_listens_on_no_other_address_without_a_token(tmp_path: Path) -> None:
    (tmp_path / "m.py").write_text(SLOW)
    environment = {**os.environ, "VSNBENCH_TOKEN": ""}
    command = [sys.executable, str(STUB), "m:Model", "--host", "0.0.0.0", "--port", str(free_port())]
    refused = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=30)
    assert refused.returncode == 1
    assert "set VSNBENCH_TOKEN" in refused.stderr
    assert len(refused.stderr.splitlines()) == 1


def test_the_stub_ends_with_ctrl_c(tmp_path: Path) -> None:
    with stub_server(SLOW, tmp_path) as (url, process):
        RemotePolicy(url).close()
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 0
        with pytest.raises(ModelLostError):
            RemotePolicy(url)


def test_the_stub_stays_what_old_interpreters_can_read() -> None:
    vermin = [sys.executable, "-c", "from vermin import main; main()", "-t=3.7-", "--no-tips", str(STUB)]
    found = subprocess.run(vermin, capture_output=True, text=True, timeout=60)
    assert found.returncode == 0, found.stdout
