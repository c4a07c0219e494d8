"""The example of an adapter over ROS 2 serves the client of vsnbench, on topics without ROS."""

import json
from types import SimpleNamespace
from typing import Any

import pytest

from tests.robots.adapter.adapters import PlaneBase
from tests.ros.ros2.wire import Wire
from vsnbench.ros.ros2.readiness import card_of_mover
from vsnbench.ros.ros2.topic_service import TopicServiceClient
from vsnbench.values.encoding.motion_answer import result_of_answer
from vsnbench.values.movement import ActionKind, Move

import ros2_adapter  # isort: skip  # adapters has its path


@pytest.fixture
def base() -> PlaneBase:
    return PlaneBase()


@pytest.fixture
def wire() -> Wire:
    return Wire()


@pytest.fixture
def service(base: PlaneBase, wire: Wire) -> Any:
    made = ros2_adapter.MovementService(base, wire.text_publisher("/move/answer"))
    wire.subscribe_text("/move/question", made.take)
    return made


@pytest.fixture
def client(wire: Wire, service: Any) -> TopicServiceClient:
    return TopicServiceClient(wire, "/move")


def request(distance_m: float = 0.5, deadline_s: float = 20.0) -> dict[str, Any]:
    movement = Move(distance_m, holds_heading=True).to_json()
    return {"request": "drive", "movement": movement, "deadline_s": deadline_s}


def drive(client: TopicServiceClient, service: Any, **asked: float) -> Any:
    """Return the answer; the adapter works while the client waits."""
    return client.call(request(**asked), 30.0, lambda: work(service))


def work(service: Any) -> None:
    """Let half a second pass for a base, which first looks whether it is at rest."""
    for _ in range(25):
        service.step()


def test_it_states_its_card(client: TopicServiceClient) -> None:
    card = card_of_mover(client, 5.0)
    assert card is not None
    assert card.condition == {"name": "plane", "version": ""}
    assert ActionKind.WAYPOINT in card.movements


def test_it_executes_a_movement(client: TopicServiceClient, service: Any, base: PlaneBase) -> None:
    start = base.at
    assert result_of_answer(drive(client, service)).completed
    assert base.at.distance_to(start) == pytest.approx(0.5, abs=0.01)
    assert base.speed == (0.0, 0.0)


def test_it_ends_a_movement_at_its_deadline(client: TopicServiceClient, service: Any, base: PlaneBase) -> None:
    result = result_of_answer(drive(client, service, deadline_s=0.5))
    assert (result.completed, result.failure) == (False, "not done after 0.5 s")


def test_a_question_that_comes_again_after_its_answer_moves_nothing(
    client: TopicServiceClient, service: Any, base: PlaneBase, wire: Wire
) -> None:
    drive(client, service)
    (asked, *_), answers = (
        [text for topic, text in wire.sent if topic == name] for name in ("/move/question", "/move/answer")
    )
    there = base.at
    service.take(asked)
    service.step()
    assert base.at == there
    assert wire.sent[-1] == ("/move/answer", answers[-1])


def test_a_new_movement_ends_the_running_one(service: Any, base: PlaneBase, wire: Wire) -> None:
    for number in (1, 2):
        service.take(json.dumps({"asker": "a", "number": number, "question": request(5.0)}))
        work(service)
    (_, answer), *more = wire.sent
    assert not more
    assert json.loads(answer)["number"] == 1
    assert json.loads(answer)["answer"]["refusal"] == "stopped"
    assert base.speed != (0.0, 0.0)


def test_it_stops_when_its_client_is_gone(service: Any, base: PlaneBase, monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [0.0]
    monkeypatch.setattr(ros2_adapter, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    question = json.dumps({"asker": "a", "number": 1, "question": request(5.0)})
    for _ in range(3):
        service.take(question)
        work(service)
        now_s[0] += ros2_adapter.GONE_S - 0.1
    assert base.speed != (0.0, 0.0)
    now_s[0] += 0.2
    service.step()
    assert base.speed == (0.0, 0.0)
    assert not service.movement.runs
