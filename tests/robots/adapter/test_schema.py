"""The messages on the socket are those of docs/schemas/motion-adapter.json and of its page."""

import json
import re
from pathlib import Path
from typing import Any

import msgpack
import pytest
from jsonschema import Draft202012Validator
from referencing import Registry, Resource

from tests.robots.adapter.adapters import PlaneBase, driven, socket_adapter
from vsnbench.models.remote import connection as wire
from vsnbench.models.remote.vsnbench_policy import ARRAY_TYPES, MAX_DIMENSIONS
from vsnbench.robots.adapter import connection
from vsnbench.values.encoding.motion_answer import MotionRefusal
from vsnbench.values.movement import Move, Trajectory, Velocity, Waypoint

DOCS = Path(__file__).resolve().parents[3] / "docs"
SCHEMA = json.loads((DOCS / "schemas" / "motion-adapter.json").read_text(encoding="utf-8"))
COMMON = json.loads((DOCS / "schemas" / "common.json").read_text(encoding="utf-8"))
PAGE = (DOCS / "motion-adapter.md").read_text(encoding="utf-8")


def validator(side: str) -> Any:
    registry = Registry().with_resources(
        [("common.json", Resource.from_contents(COMMON)), ("", Resource.from_contents(SCHEMA))]
    )
    return Draft202012Validator({"$ref": f"#/$defs/{side}", "$defs": SCHEMA["$defs"]}, registry=registry)


def test_the_schema_is_valid() -> None:
    Draft202012Validator.check_schema(SCHEMA)


def test_every_message_of_a_session_is_in_the_schema(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sent: dict[str, list[Any]] = {"client": [], "adapter": []}

    def recording(side: str, pack: Any) -> Any:
        return lambda message: sent[side].append(message) or pack(message)

    monkeypatch.setattr(wire, "pack", recording("client", wire.pack))
    monkeypatch.setattr(connection, "pack", recording("client", connection.pack))
    monkeypatch.setattr(socket_adapter, "packb", recording("adapter", msgpack.packb))
    with driven(PlaneBase(), tmp_path) as robot:
        robot.observe()
        for movement in (Move(0.2), Waypoint(0.2, 0.1, 0.5), Trajectory(((0.1, 0.0), (0.2, 0.0))), Velocity(0.1)):
            robot.drive(movement, lambda _: "")
        robot.drive(Waypoint(1.0, 0.0), lambda view: "a wall" if view.remaining_m < 0.9 else "")
    for side, messages in sent.items():
        for message in messages:
            validator(side).validate(message)
    kinds = {message["type"] for messages in sent.values() for message in messages}
    assert kinds >= {"hello", "state", "begin", "observe", "drive", "go", "stop", "bye"}
    assert kinds >= {"card", "ready", "observation", "progress", "done"}
    refused = [message["refusal"] for message in sent["adapter"] if message.get("refusal")]
    assert refused == ["stopped"]


@pytest.mark.parametrize(
    "message",
    [
        {"type": "done", "seq": 1, "pose": [0, 0, 0], "stamp_s": 1, "completed": False, "refusal": "tired"},
        {"type": "done", "seq": 1, "pose": [0, 0], "stamp_s": 1, "completed": True},
        {"type": "progress", "seq": 1, "stamp_s": 1},
        {"type": "card", "wire": 2, "card": {"name": "x"}},
        {"type": "card", "wire": 1, "card": {"name": "x", "movements": ["velocity"]}},
    ],
)
def test_what_breaks_the_protocol_is_not_in_the_schema(message: dict[str, Any]) -> None:
    assert not validator("adapter").is_valid(message)


def test_arrays_are_those_of_the_wire() -> None:
    properties = SCHEMA["$defs"]["array"]["properties"]
    assert properties["dtype"]["enum"] == list(ARRAY_TYPES)
    assert properties["shape"]["maxItems"] == MAX_DIMENSIONS


def test_page_schema_and_code_have_the_same_refusals() -> None:
    (done,) = (form for form in SCHEMA["$defs"]["adapter"]["oneOf"] if form["properties"]["type"]["const"] == "done")
    assert set(done["properties"]["refusal"]["enum"]) - {None} == set(MotionRefusal)
    table = PAGE[PAGE.index("### Refusals") : PAGE.index("## Over a socket")]
    assert set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) - {"refusal"} == set(MotionRefusal)
