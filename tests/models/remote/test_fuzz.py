"""Client and server survive any received bytes, with bounded memory and without running them."""

import os
import pickle
import random
from pathlib import Path
from typing import Any

import msgpack
import psutil
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.sync.server import ServerConnection

from tests.models.remote.servers import CARD, look, scripted_server, stub_server
from vsnbench.errors import VsnbenchError
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.vsnbench_policy import WireError, pack, unpack

FRAMES = int(os.environ.get("VSNBENCH_FUZZ_FRAMES", "100"))
SEED = int(os.environ.get("VSNBENCH_FUZZ_SEED", "1"))
MOST_MEMORY = 500 * 2**20
MODEL = """
class Model:
    card = {"name": "fuzzed", "sensors": ["rgb", "depth", "odometry"]}

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        return "TURN_LEFT"
"""
IMAGE = {"encoding": "raw", "height": 2, "width": 2, "data": bytes(12)}
DEPTH = {"encoding": "f32", "height": 2, "width": 2, "data": bytes(16)}
ARRAYS = {"scan_m": {"dtype": "float32", "shape": [2, 3], "data": bytes(24)}}
ACT = {"type": "act", "seq": 3, "stamp_s": 1.0, "camera": {}, "rgb": IMAGE, "depth": DEPTH, "pose": [0.0, 0.0, 0.0]}
ACT |= {"arrays": ARRAYS}
QUESTIONS = [ACT, {"type": "reset", "seq": 1, "goal": "chair", "seed": 1}, {"type": "hello", "wire": 2, "token": ""}]
DECISION = {
    "type": "decision",
    "seq": 2,
    "action": "STOP",
    "raw_action": "STOP",
    "probabilities": {"STOP": 1.0},
    "diagnostics": {"boxes": [[1, 2, 3, 4, "chair", 0.5]], "path": [[0, 1]], "note": "here", "details": {"a": [1, {}]}},
    "seconds": 0.1,
}
VALUES: list[Any] = [
    *(None, True, -1, 0, 2**63 - 1, -(2**63), 1e308, float("nan"), float("inf")),
    *("", "\ud800", "a" * 70_000, "__import__('os')", "cos\nsystem\n", b"\0" * 99, b"\x80\x04K\x01."),
    *([], {}, [[[[[[]]]]]], {"a": {"a": {"a": {}}}}, [0] * 5000),
]


def mutated(message: Any, draw: random.Random) -> bytes:
    """Return a message with a value exchanged, a key dropped, or its bytes broken."""
    if draw.random() < 0.6:
        message = exchanged(message, draw)
    content = bytearray(msgpack.packb(message, use_bin_type=True, unicode_errors="surrogatepass"))
    for _ in range(draw.choice((0, 0, 1, 3))):
        content[draw.randrange(len(content))] = draw.randrange(256)
    if draw.random() < 0.15:
        del content[draw.randrange(len(content)) :]
    if draw.random() < 0.1:
        content += draw.randbytes(draw.randrange(200))
    return bytes(content)


def exchanged(value: Any, draw: random.Random) -> Any:
    if isinstance(value, dict) and value and draw.random() < 0.9:
        key = draw.choice(sorted(value))
        if draw.random() < 0.1:
            return {name: item for name, item in value.items() if name != key}
        return {**value, key: exchanged(value[key], draw)}
    return draw.choice(VALUES)


def test_a_server_survives_every_frame(tmp_path: Path) -> None:
    draw = random.Random(SEED)
    with stub_server(MODEL, tmp_path) as (url, process):
        server, sent = psutil.Process(process.pid), 0
        while sent < FRAMES:
            with connect(url, compression=None, max_size=None, legacy=True, proxy=None) as client:
                try:
                    if draw.random() < 0.8:
                        client.send(pack({"type": "hello", "wire": 2, "token": ""}))
                        client.recv(timeout=10)
                    for _ in range(20):
                        client.send(mutated(draw.choice(QUESTIONS), draw))
                        sent += 1
                        client.recv(timeout=10)
                except (ConnectionClosed, TimeoutError):
                    continue
        assert process.poll() is None
        assert server.memory_info().rss < MOST_MEMORY
        policy = RemotePolicy(url)
        policy.reset("chair", 0)
        assert policy.act(look()).action.value == "TURN_LEFT"
        policy.close()


def test_a_client_survives_every_frame() -> None:
    draw, before = random.Random(SEED + 1), psutil.Process().memory_info().rss

    def answer(connection: ServerConnection, message: dict[str, Any]) -> None:
        if message["type"] == "reset":
            connection.send(pack({"type": "ready", "seq": message["seq"]}))
        else:
            connection.send(mutated({**DECISION, "seq": message["seq"]}, draw))

    def greeted() -> bytes:
        card = {**CARD, "settings": {"a": 1}}
        return mutated({"type": "card", "wire": 2, "card": card, "jpeg": False}, draw)

    refused = taken = 0
    while refused + taken < FRAMES:
        greeting = greeted() if draw.random() < 0.05 else None
        with scripted_server(answer, greeting) as url:
            try:
                policy = RemotePolicy(url, act_timeout=2.0)
                for _ in range(50):
                    try:
                        policy.reset("chair", 0)
                        policy.act(look(8, 8))
                        taken += 1
                    except VsnbenchError:
                        refused += 1
                policy.close()
            except VsnbenchError:
                refused += 1
    assert refused > FRAMES / 4
    assert taken > FRAMES / 20
    assert psutil.Process().memory_info().rss - before < MOST_MEMORY


PICKLE = b"\x80\x04\x95\x1d\x00\x00\x00\x00\x00\x00\x00\x8c\x05posix"
EXTENSION = b"\xc8\x00\x04\x01abcd"


@pytest.mark.parametrize("hostile", [PICKLE, EXTENSION])
def test_no_pickle_and_no_extension_is_ever_unpacked(hostile: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("loads", "load", "Unpickler"):
        monkeypatch.delattr(pickle, name)
    with pytest.raises(WireError):
        unpack(hostile)
