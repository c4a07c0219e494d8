"""The bytes shown in docs/wire.md encode its messages, and a client accepts them."""

import json
import re
from pathlib import Path
from typing import Any

from websockets.sync.server import ServerConnection

from tests.models.remote.servers import look, scripted_server
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.vsnbench_policy import _common_version, pack, unpack
from vsnbench.models.synthetic import synthetic_task
from vsnbench.values.movement import Action
from vsnbench.values.observation import observation_of

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "wire.md").read_text(encoding="utf-8")
EXAMPLE = re.compile(r"^(\{.*\})\n([0-9a-f]+)$", re.MULTILINE)


def test_the_example_is_a_session_that_a_client_accepts() -> None:
    pairs = [(json.loads(text), bytes.fromhex(content)) for text, content in EXAMPLE.findall(PAGE)]
    assert [(message, pack(message)) for message, _ in pairs] == [(unpack(content), content) for _, content in pairs]
    (hello, _), (card, greeting), (_, ready), (_, decision) = pairs
    assert _common_version(hello) == card["wire"]

    def answer(connection: ServerConnection, message: dict[str, Any]) -> None:
        connection.send(ready if message["type"] == "reset" else decision)

    with scripted_server(answer, greeting) as url:
        policy = RemotePolicy(url)
        policy.begin(synthetic_task("chair", 0))
        assert policy.act(observation_of(0.0, look().camera)).action is Action.STOP
