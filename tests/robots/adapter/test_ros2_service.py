"""The example of an adapter over ROS 2 serves the client of vsnbench, on topics without ROS."""

import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from tests.robots.adapter.adapters import PlaneBase
from tests.ros.ros2.wire import Wire
from vsnbench.ros.ros2.readiness import card_of_mover
from vsnbench.ros.ros2.topic_service import TopicServiceClient
from vsnbench.values.action import ActionKind
from vsnbench.values.encoding.motion_answer import result_of_answer
from vsnbench.values.movement import Move, movement_to_json

import ros2_adapter  # isort: skip  # adapters has its path


@pytest.fixture
def base() -> PlaneBase:
    return PlaneBase()


@pytest.fixture
def client(base: PlaneBase) -> TopicServiceClient:
    wire, moving = Wire(), threading.Lock()

    def answer(request: dict[str, Any], gone: Callable[[], bool]) -> dict[str, Any]:
        return ros2_adapter.answer_with(base, moving, request, gone)

    service = ros2_adapter.MovementService(wire.text_publisher("/move/answer"), answer)
    wire.subscribe_text("/move/question", service.on_question)
    return TopicServiceClient(wire, "/move")


def drive(client: TopicServiceClient, deadline_s: float = 20.0) -> Any:
    movement = movement_to_json(Move(0.5, holds_heading=True))
    return client.call({"request": "drive", "movement": movement, "deadline_s": deadline_s}, 30.0)


def test_it_states_its_card(client: TopicServiceClient) -> None:
    card = card_of_mover(client, 5.0)
    assert card is not None
    assert card.condition == {"name": "plane", "version": ""}
    assert ActionKind.WAYPOINT in card.movements


def test_it_executes_a_movement(client: TopicServiceClient, base: PlaneBase) -> None:
    start = base.at
    assert result_of_answer(drive(client)).completed
    assert base.at.distance_to(start) == pytest.approx(0.5, abs=0.01)
    assert base.speed == (0.0, 0.0)


def test_it_ends_a_movement_at_its_deadline(client: TopicServiceClient, base: PlaneBase) -> None:
    result = result_of_answer(drive(client, deadline_s=0.5))
    assert (result.completed, result.failure) == (False, "not done after 0.5 s")


def test_it_stops_when_its_client_is_gone(
    client: TopicServiceClient, base: PlaneBase, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s, stopped, left = [0.0], threading.Event(), threading.Event()
    monkeypatch.setattr(ros2_adapter, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    send, stop = base.send, base.stop

    def waiting(forward_m_s: float, turn_rad_s: float) -> str:
        left.wait(30.0)
        return send(forward_m_s, turn_rad_s)

    monkeypatch.setattr(base, "send", waiting)
    monkeypatch.setattr(base, "stop", lambda: (stop(), stopped.set()))

    def leave() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        client.call({"request": "drive", "movement": movement_to_json(Move(5.0)), "deadline_s": 60.0}, 30.0, leave)
    now_s[0] = ros2_adapter.GONE_S + 0.1
    left.set()
    assert stopped.wait(30.0)
    assert base.speed == (0.0, 0.0)
