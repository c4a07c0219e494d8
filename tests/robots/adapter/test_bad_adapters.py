"""Adapters that break the protocol: each gets one line, and none leaves the client waiting."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.models.remote.servers import scripted_server
from tests.robots.adapter.adapters import CARD, STATE, PlaneBase, driven, reply, scripted, write_profile
from vsnbench.errors import RobotError
from vsnbench.robots.adapter import connection
from vsnbench.robots.adapter.robot import AdapterRobot
from vsnbench.robots.profiles import load_profile
from vsnbench.values.movement import Move

FORWARD = Move(0.25, holds_heading=True)


def test_an_adapter_that_says_done_at_once_is_contradicted_by_its_odometry(tmp_path: Path) -> None:
    def on_drive(client: Any, message: dict[str, Any]) -> None:
        if message["type"] == "drive":
            reply(client, message, "done", completed=True, **STATE)

    with scripted(on_drive, tmp_path) as robot:
        result = robot.drive(FORWARD)
    assert not result.completed
    assert result.failure == (
        "the adapter answered that it is done: move forward by 0.25 m, but the odometry moved 0.0 cm and turned 0.0° "
        "instead of 25 cm and 0°"
    )


def test_an_adapter_that_never_answers_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seconds in (("ANSWER_S", 0.5), ("PROGRESS_S", 0.1), ("GONE_S", 0.1)):
        monkeypatch.setattr(connection, name, seconds)
    heard: list[str] = []
    with scripted(lambda _, message: heard.append(message["type"]), tmp_path) as robot:
        result = robot.drive(FORWARD)
    assert "does not answer `stop`: stop the robot by hand" in result.failure
    assert heard[:2] == ["drive", "stop"]


@pytest.mark.parametrize(
    ("answer", "found"),
    [
        ({"completed": "yes"}, "`completed` must be true or false, not 'yes'"),
        ({"completed": False, "refusal": "tired"}, "not 'tired'"),
        ({"completed": False, "refusal": ["fault"]}, "not ['fault']"),
        ({"completed": False, "refusal": "fault", "failure": ["low"]}, "`failure` must be a text"),
        ({"completed": True, "pose": [1, 2]}, "`pose` must be a list of 3 numbers"),
        ({"completed": True, "stamp_s": "soon"}, "`stamp_s` must be a finite number, not 'soon'"),
        ({"completed": True, "type": "nonsense"}, "answered drive with 'nonsense'"),
        ({"completed": True, "seq": 1000}, "answered request 1000, which was not sent"),
    ],
)
def test_answers_that_break_the_protocol_are_named(tmp_path: Path, answer: dict[str, Any], found: str) -> None:
    def on_drive(client: Any, message: dict[str, Any]) -> None:
        if message["type"] == "drive":
            client.send(connection.pack({"type": "done", "seq": message["seq"], **STATE, **answer}))

    with scripted(on_drive, tmp_path) as robot:
        result = robot.drive(FORWARD)
    assert not result.completed
    assert found in result.failure
    assert "\n" not in result.failure


def test_bytes_that_are_no_message_are_named(tmp_path: Path) -> None:
    with scripted(lambda client, _: client.send(b"\xc1rubbish"), tmp_path) as robot:
        result = robot.drive(FORWARD)
    assert "sent an invalid message" in result.failure


def test_a_message_that_is_too_large_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "ADAPTER", replace(connection.ADAPTER, max_bytes=4000))
    with scripted(lambda client, _: client.send(bytes(5000)), tmp_path) as robot:
        result = robot.drive(FORWARD)
    assert "sent more than 4000 bytes in a message" in result.failure


@pytest.mark.parametrize(
    ("greeting", "code", "found"),
    [
        ({**CARD, "wire": 2}, "wrong-protocol-version", "uses version 2 of the protocol, not 1"),
        ({**CARD, "card": {"name": ""}}, "invalid-card", "the card has no `name`"),
        ({**CARD, "card": {"name": "x", "movements": ["jump", "move"]}}, "invalid-card", "`movements` has 'jump'"),
        ({**CARD, "card": {"name": "x", "movements": ["velocity"]}}, "invalid-card", "lack `move`"),
        ({**CARD, "card": {"name": "x", "simulation": {"site": "flat"}}}, "invalid-card", "simulation.simulator"),
        (
            {**CARD, "card": {"name": "x", "simulation": {"a\nb": 1, "simulator": 7}}},
            "invalid-card",
            "the card's simulation",
        ),
        ({"type": "error", "code": "version", "message": "only 7"}, "refused", "refuses: only 7"),
        ({"type": "error", "code": "token", "message": "no"}, "wrong-token", "$VSNBENCH_TOKEN"),
        (b"hello", "invalid-message", "invalid message"),
    ],
)
def test_a_wrong_greeting_is_refused(tmp_path: Path, greeting: dict[str, Any] | bytes, code: str, found: str) -> None:
    with pytest.raises(RobotError) as refused, scripted(lambda *_: None, tmp_path, greeting):
        raise AssertionError
    assert refused.value.code == code
    assert found in str(refused.value)
    assert "\n" not in str(refused.value)


def test_an_adapter_that_does_not_run_is_named(tmp_path: Path) -> None:
    with pytest.raises(RobotError) as refused:
        AdapterRobot(load_profile(write_profile(tmp_path, "ws://127.0.0.1:1")))
    assert refused.value.code == "no-server"
    assert "interface.address" in refused.value.advice


def test_another_adapter_at_the_same_address_ends_the_session(tmp_path: Path) -> None:
    base = PlaneBase()
    with driven(base, tmp_path) as robot:
        base.card = {**base.card, "version": "2"}
        robot._link.live().close()
        with pytest.raises(RobotError) as refused:
            robot.locate()
    assert refused.value.code == "other-adapter"


def test_a_simulator_of_another_profile_is_refused(tmp_path: Path) -> None:
    account = {"simulator": "mine", "site": "flat", "site_sha256": "0" * 64, "profile_sha256": "1" * 64}
    card = {"name": "x", "simulation": {**account, "odometry_rate_hz": 50, "rate_factor": 1}}
    with (
        scripted_server(lambda *_: None, {**CARD, "card": card}) as address,
        pytest.raises(RobotError) as refused,
    ):
        AdapterRobot(load_profile(write_profile(tmp_path, address)))
    assert refused.value.code == "other-simulated-robot"
