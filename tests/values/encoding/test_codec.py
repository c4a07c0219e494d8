"""Observations, decisions and diagnostics survive encoding; invalid received data are refused."""

import base64
import json
import math
import struct
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.errors import DecisionError
from vsnbench.models.remote.vsnbench_policy import Camera as RemoteCamera
from vsnbench.models.remote.vsnbench_policy import Observation as RemoteObservation
from vsnbench.models.remote.vsnbench_policy import WireError, decision_of, observation_of, pack, unpack
from vsnbench.values.camera import Camera
from vsnbench.values.decision import Box, Decision, Diagnostics, GridMap
from vsnbench.values.encoding.codec import (
    decision_from_message,
    decision_from_record,
    decision_to_message,
    diagnostics_to_details,
    observation_to_message,
)
from vsnbench.values.movement import DISCRETE_ACTIONS, Action, Chunk, Move, Pixel, Trajectory, Velocity, Waypoint
from vsnbench.values.observation import Observation, Sensor, shown_to_policy
from vsnbench.values.pose import Pose, wrap_angle

CELLS = np.random.default_rng(0).integers(0, 3, (40, 60), np.uint8)
FULL = Decision(
    Action.MOVE_BACKWARD,
    "LOOK_UP",
    Diagnostics(
        probabilities={"STOP": 0.25, "LOOK_UP": 0.75},
        boxes=(Box(1, 2, 30.5, 40, "sofa", 0.875),),
        map=GridMap(CELLS, -1.5, 2.25, 0.05),
        sub_goal=(1.0, 2.0),
        path=((0.0, 0.0), (1.0, 2.0)),
        nodes=((0.5, 0.5),),
        scalars={"value": 1.5, "unknown": math.nan},
        note="going to the sofa",
        details={"logits": [1.0, 2.0], "mode": {"name": "travel"}},
    ),
)


def alike(one: Decision, other: Decision) -> bool:
    first, second = one.diagnostics, other.diagnostics
    assert first.map is not None
    assert second.map is not None
    np.testing.assert_array_equal(first.map.cells, second.map.cells)
    np.testing.assert_equal(dict(first.scalars), dict(second.scalars))
    place = [(m.origin_x_m, m.origin_y_m, m.resolution_m) for m in (first.map, second.map)]
    rest = [
        (d.action, d.raw_action, t.probabilities, t.boxes, t.sub_goal, t.path, t.nodes, t.note, t.details)
        for d, t in ((one, first), (other, second))
    ]
    return place[0] == place[1] and rest[0] == rest[1]


def test_a_decision_survives_as_json() -> None:
    message = json.loads(json.dumps(decision_to_message(FULL), allow_nan=False))
    assert alike(decision_from_message(message), FULL)


MOVEMENTS = (
    Move(0.5, -1.0),
    Waypoint(1.0, -0.5),
    Waypoint(1.0, 0.5, 0.25),
    Trajectory(((0.5, 0.0), (1.0, 0.5))),
    Velocity(0.2, -0.5, 1.5),
    Velocity(0.2, 0.0, 1.5, -0.1),
    Pixel(10.5, 20.0),
    Chunk((Action.TURN_LEFT, Waypoint(0.5, 0.0), Move(0.25))),
)


@pytest.mark.parametrize("decision", [FULL, *map(Decision, [*DISCRETE_ACTIONS, *MOVEMENTS])], ids=str)
def test_the_stand_alone_file_sends_what_the_codec_reads(decision: Decision) -> None:
    message = unpack(pack({"type": "decision", **decision_of(decision_to_message(decision))}))
    arrived = decision_from_message(message)
    assert (arrived.action, arrived.raw_action) == (decision.action, decision.raw_action)
    assert (arrived.movement, arrived.parts) == (decision.movement, decision.parts)
    assert decision_to_message(arrived) == decision_to_message(decision)


def test_a_decision_survives_in_the_columns_of_the_record() -> None:
    told = FULL.diagnostics
    details = json.loads(json.dumps(diagnostics_to_details(told), allow_nan=False)) | {"sensing": {"frames": 10}}
    assert alike(decision_from_record(Action.MOVE_BACKWARD, "LOOK_UP", dict(told.probabilities), details), FULL)


def test_an_action_alone_is_a_decision() -> None:
    bare = decision_from_message({"action": "STOP"})
    assert (bare.action, bare.raw_action, bare.diagnostics.note) == (Action.STOP, "STOP", "")
    assert decision_to_message(bare) == {"action": "STOP", "raw_action": "STOP", "probabilities": {}, "diagnostics": {}}


def with_map(**changes: Any) -> dict[str, Any]:
    shown = decision_to_message(FULL)["diagnostics"]["map"] | changes
    return {"action": "STOP", "diagnostics": {"map": shown}}


def png_that_claims(width: int, height: int) -> str:
    png = cv2.imencode(".png", CELLS)[1].tobytes()
    return base64.b64encode(png[:16] + struct.pack(">II", width, height) + png[24:]).decode()


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ([], "expected a decision, got a list"),
        ({}, "action must be one of STOP"),
        ({"action": ["STOP"]}, "action must be one of STOP"),
        ({"action": "STOP", "raw_action": 17}, "raw_action must be text"),
        ({"action": "STOP", "diagnostics": [1]}, "must be a mapping, got a list"),
        ({"action": "STOP", "probabilities": [0.5]}, "probabilities must be a mapping"),
        ({"action": "STOP", "diagnostics": {"boxes": [[1, 2, 3]]}}, "boxes must be a list of"),
        ({"action": "STOP", "diagnostics": {"boxes": [[1, 2, 3, 4, 5, 6]]}}, "label must be text"),
        ({"action": "STOP", "diagnostics": {"sub_goal": []}}, "sub_goal must be a point"),
        ({"action": "STOP", "diagnostics": {"scalars": [1]}}, "scalars must be a mapping"),
        ({"action": "STOP", "diagnostics": {"path": [[1, 10**400]]}}, r"path\[0\] must be a number"),
        (with_map(png="not base64!"), "must be base64"),
        (with_map(png=base64.b64encode(b"GIF89a").decode()), "must be a PNG"),
        (with_map(png=png_that_claims(30_000, 30_000)), "30000 x 30000 cells"),
        (with_map(png=png_that_claims(2000, 2000)), r"damaged|must be 0|shape|too large"),
        (with_map(png="A" * 10**8), "characters"),
        (with_map(origin_m=[1]), "origin_m must be a point"),
        (with_map(resolution_m=None), "resolution_m must be a number"),
        (with_map(png=base64.b64encode(cv2.imencode(".png", CELLS + 7)[1].tobytes()).decode()), "must be 0 .unknown"),
    ],
)
def test_an_invalid_message_is_refused(message: object, words: str) -> None:
    with pytest.raises(DecisionError, match=words):
        decision_from_message(message)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=10) | st.binary(max_size=10),
    lambda inner: st.lists(inner, max_size=6) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=15,
)
PARTS = ("boxes", "map", "sub_goal", "path", "nodes", "scalars", "note", "details")


@given(VALUES, st.dictionaries(st.sampled_from(PARTS), VALUES))
def test_any_message_is_decoded_or_refused(probabilities: object, parts: dict[str, object]) -> None:
    message = {"action": "TURN_LEFT", "probabilities": probabilities, "diagnostics": parts}
    try:
        made = decision_from_message(message)
    except DecisionError:
        return
    assert decision_from_message(json.loads(json.dumps(decision_to_message(made), allow_nan=False)))


@given(VALUES, VALUES, st.dictionaries(st.sampled_from(PARTS), VALUES))
def test_a_record_whose_diagnostics_are_damaged_still_shows_the_action(
    probabilities: object, details: object, shown: dict[str, object]
) -> None:
    for column in (details, {"shown": shown}, {"shown": details}):
        decision = decision_from_record(Action.TURN_LEFT, "LOOK\x1b_UP" * 30, probabilities, column)
        assert decision.action is Action.TURN_LEFT
        assert decision.raw_action.isprintable()


CAMERA = Camera(width=64, height=48, horizontal_fov_deg=60, mount_height_m=0.6, tilt_deg=-5)


def seen() -> Observation:
    depth_m = np.random.default_rng(2).uniform(0.3, 6, (48, 64)).astype(np.float32)
    depth_m[:3] = np.nan
    rgb = cv2.GaussianBlur(np.random.default_rng(1).integers(0, 255, (48, 64, 3), np.uint8), (0, 0), 5)
    beyond_range = np.zeros((48, 64), np.bool_)
    beyond_range[:2, 5:] = True
    return Observation(rgb, depth_m, Pose(0.5, -0.25, 7.0), 12.5, CAMERA, beyond_range=beyond_range)


def received(message: object) -> RemoteObservation:
    """Return the observation that a model's server decodes from a message."""
    return observation_of(unpack(pack({"type": "act"} | message if isinstance(message, dict) else message)))


def test_an_observation_crosses_bit_for_bit() -> None:
    there = received(observation_to_message(seen()))
    np.testing.assert_array_equal(there.rgb, seen().rgb)
    np.testing.assert_array_equal(np.asarray(there.depth_m), np.asarray(seen().depth_m))
    np.testing.assert_array_equal(np.asarray(there.beyond_range), np.asarray(seen().beyond_range))
    assert (there.pose.x_m, there.pose.y_m, there.pose.heading_rad) == (0.5, -0.25, 7.0)
    assert there.stamp_s == 12.5
    assert vars(there.camera) == vars(RemoteCamera(CAMERA.model_dump(mode="json")))


def test_an_observation_can_be_sent_compressed() -> None:
    message = observation_to_message(seen(), rgb="jpeg", depth="mm16")
    there = received(message)
    assert len(message["depth"]["data"]) == 2 * 48 * 64
    assert np.abs(there.rgb.astype(int) - seen().rgb).mean() < 3
    assert there.depth_m is not None
    np.testing.assert_allclose(there.depth_m, np.asarray(seen().depth_m), atol=0.00051)


def test_undeclared_sensors_are_not_sent() -> None:
    message = observation_to_message(shown_to_policy(seen(), frozenset({Sensor.ODOMETRY})))
    assert (message["rgb"], message["depth"], message["pose"]) == (None, None, [0.5, -0.25, wrap_angle(7.0)])
    there = received(message)
    assert (there.rgb, there.depth_m) == (None, None)


SCAN = {"dtype": "float32", "shape": [2, 3], "data": np.arange(6, dtype="<f4").tobytes()}


def test_arrays_are_attributes_of_what_a_server_receives() -> None:
    thermal = {"dtype": "uint16", "shape": [1], "data": b"\x01\x02"}
    there = received(observation_to_message(seen()) | {"arrays": {"scan_m": SCAN, "thermal": thermal}})
    np.testing.assert_array_equal(there.scan_m, np.arange(6, dtype=np.float32).reshape(2, 3))
    assert (there.scan_m.dtype, there.thermal.tolist()) == (np.float32, [0x0201])
    assert not there.scan_m.flags.writeable
    assert not hasattr(received(observation_to_message(seen())), "scan_m")


@pytest.mark.parametrize(
    "arrays",
    [
        [SCAN],
        {f"scan_{number}": SCAN for number in range(17)},
        *({name: SCAN} for name in ("rgb", "depth_m", "history", "arrays", "camera", "stamp_s")),
        *({name: SCAN} for name in ("", "_scan", "__class__", "__init__", "scan m", "SCAN", "class", "é", "s" * 41)),
        {"scan_m": None},
        *(
            {"scan_m": SCAN | {"dtype": kind}}
            for kind in ("object", "O", "<f4", "float16", "bool", "S4", None, ["float32"])
        ),
        *(
            {"scan_m": SCAN | {"shape": shape}}
            for shape in (6, [], [6.0], [True, 6], [-2, -3], [0], [7], [1, 1, 1, 1, 6])
        ),
        {"scan_m": SCAN | {"shape": [2**32, 2**32], "data": b""}},
        {"scan_m": SCAN | {"shape": [2**20] * 4}},
        {"scan_m": SCAN | {"data": "text"}},
        {"scan_m": SCAN | {"data": SCAN["data"] + b"1"}},
    ],
)
def test_an_invalid_array_is_refused(arrays: object) -> None:
    with pytest.raises(WireError):
        received(observation_to_message(seen()) | {"arrays": arrays})


def changed(name: str, **changes: Any) -> Callable[[dict[str, Any]], object]:
    return lambda message: message | {name: message[name] | changes}


@pytest.mark.parametrize(
    "spoil",
    [
        lambda _message: [],
        lambda message: message | {"camera": None},
        lambda message: message | {"stamp_s": float("nan")},
        lambda message: message | {"pose": [1, 2]},
        lambda message: message | {"pose": [1, 2, float("inf")]},
        lambda message: message | {"rgb": "pixels"},
        changed("rgb", width=63),
        changed("rgb", height=-48, width=-64),
        changed("rgb", height=True),
        changed("rgb", data="text"),
        changed("rgb", encoding="png"),
        changed("rgb", encoding="jpeg"),
        changed("rgb", encoding="jpeg", data=b"\xff\xd8\xff"),
        changed("depth", encoding="mm16"),
        changed("depth", encoding=["f32"]),
        changed("depth", data=b"abc"),
        changed("depth", beyond_range=b"abc"),
        changed("depth", beyond_range="text"),
    ],
)
def test_an_invalid_observation_is_refused(spoil: Callable[[dict[str, Any]], object]) -> None:
    with pytest.raises(WireError):
        received(spoil(observation_to_message(seen())))
