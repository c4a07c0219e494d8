"""A person as a model: who has the controls, which answers count, and the name in the record."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

import pytest

from tests.models.looks import look
from tests.processes import wait_until
from vsnbench.errors import ModelError, ModelLostError, UsageError
from vsnbench.models.description import describe_model
from vsnbench.models.human import controls as rules
from vsnbench.models.human.controls import NO_LIMITS, Controls, ControlsError, Phase
from vsnbench.models.human.policy import Human
from vsnbench.models.registry import create_policy
from vsnbench.values.decision import Decision
from vsnbench.values.movement import Action

Answer = TypeVar("Answer")


@pytest.fixture
def controls() -> Controls:
    held = Controls("ada")
    held.is_served = True
    return held


def later(call: Callable[..., Answer], *arguments: Any) -> "Future[Answer]":
    """Call from another thread, as the runner does, which waits for the driver; the thread ends with the process."""
    answer: Future[Answer] = Future()

    def run() -> None:
        try:
            answer.set_result(call(*arguments))
        except Exception as error:
            answer.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return answer


def offered(controls: Controls) -> "Future[None]":
    """Offer a trial from another thread."""
    offer = later(controls.offer_trial, "chair")
    wait_until(lambda: controls.view.phase is Phase.READY, "the trial is offered")
    return offer


def asked(controls: Controls) -> "Future[Action]":
    """Ask for an action from another thread."""
    before = controls.view.picture
    answer = later(controls.ask, b"jpeg", NO_LIMITS)
    wait_until(lambda: controls.view.picture == before + 1, "the picture is shown")
    return answer


def test_the_trial_begins_when_the_driver_takes_the_controls(controls: Controls) -> None:
    offer = offered(controls)
    assert not offer.done(), "no time limit: it waits for a driver"
    controls.take("phone")
    offer.result(60)
    assert controls.is_held_by("phone")


def test_a_second_browser_is_refused_with_the_name_of_the_driver(controls: Controls) -> None:
    offer = offered(controls)
    controls.take("phone")
    offer.result(60)
    answer = asked(controls)
    for attempt in (
        lambda: controls.take("tablet"),
        lambda: controls.choose("tablet", 1, Action.MOVE_FORWARD),
    ):
        with pytest.raises(ControlsError, match="ada drives") as refusal:
            attempt()
        assert refusal.value.code == "driven-already"
    assert not answer.done(), "nothing moves"
    controls.choose("phone", 1, Action.TURN_LEFT)
    assert answer.result(60) is Action.TURN_LEFT


def test_the_controls_are_free_again_once_their_page_is_silent(
    controls: Controls, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 100.0
    monkeypatch.setattr(rules.time, "monotonic", lambda: now_s)
    controls.take("phone")
    now_s += rules.SILENT_S
    with pytest.raises(ControlsError):
        controls.take("tablet")
    controls.hear("phone")
    now_s += rules.SILENT_S
    with pytest.raises(ControlsError):
        controls.take("tablet")
    now_s += 0.1
    controls.hear("tablet")  # a page that only looks on keeps nobody out
    controls.take("tablet")
    assert controls.is_held_by("tablet")


@pytest.mark.parametrize("picture", [0, 2])
def test_an_action_for_another_picture_is_refused(controls: Controls, picture: int) -> None:
    controls.take("phone")
    answer = asked(controls)
    with pytest.raises(ControlsError) as refusal:
        controls.choose("phone", picture, Action.STOP)
    assert refusal.value.code == "answered-meanwhile"
    controls.choose("phone", 1, Action.MOVE_FORWARD)
    assert answer.result(60) is Action.MOVE_FORWARD


def test_a_picture_gets_one_action(controls: Controls) -> None:
    controls.take("phone")
    answer = asked(controls)
    controls.choose("phone", 1, Action.MOVE_FORWARD)
    with pytest.raises(ControlsError):
        controls.choose("phone", 1, Action.STOP)
    assert answer.result(60) is Action.MOVE_FORWARD
    second = asked(controls)
    assert not second.done(), "the refused STOP does not wait for the next picture"
    controls.choose("phone", 2, Action.TURN_RIGHT)
    assert second.result(60) is Action.TURN_RIGHT


def test_the_time_limit_of_an_action_begins_when_its_picture_is_shown(controls: Controls) -> None:
    controls.act_timeout_s = 1e-9
    controls.take("phone")
    answer = asked(controls)
    controls.shown("tablet", 1)
    controls.shown("phone", 0)
    controls.choose("phone", 1, Action.MOVE_FORWARD)
    assert answer.result(60) is Action.MOVE_FORWARD, "no limit while the driver does not see the picture"
    answer = asked(controls)
    controls.shown("phone", 2)
    with pytest.raises(ModelLostError, match="ada chose no action"):
        answer.result(60)


def test_views_are_pushed_to_the_page_until_the_session_is_over(controls: Controls) -> None:
    seen: list[Phase] = []
    controls.listeners.append(lambda: seen.append(controls.view.phase))
    controls.end_trial()
    controls.close()
    assert seen == [Phase.PREPARING, Phase.ENDED]


def test_nobody_can_drive_without_a_page() -> None:
    policy = Human("ada")
    with pytest.raises(ModelError) as refusal:
        policy.reset("chair", 0)
    assert refusal.value.code == "no-driver-page"


def test_the_driver_is_shown_the_goal_in_words_and_the_camera_image() -> None:
    policy = Human("ada")
    policy.controls.is_served = True
    begun = later(policy.reset, "potted plant", 0)
    wait_until(lambda: policy.controls.view.phase is Phase.READY, "the trial is offered")
    policy.controls.take("phone")
    begun.result(60)
    decision: Future[Decision] = later(policy.act, look())
    wait_until(lambda: policy.controls.view.phase is Phase.CHOOSING, "the picture is shown")
    assert policy.controls.view.goal == "potted plant"
    assert policy.controls.picture_jpeg.startswith(b"\xff\xd8")
    policy.controls.choose("phone", 1, Action.STOP)
    assert decision.result(60).action is Action.STOP
    policy.end_episode()
    assert policy.controls.view.phase is Phase.PREPARING


@pytest.mark.parametrize(
    ("make", "variable", "driver"),
    [
        (lambda: create_policy("human:Ada Lovelace"), "maria", "Ada Lovelace"),
        (lambda: create_policy("human"), "maria", "maria"),
        (lambda: Human("Ada\n\tL."), "", "Ada L."),
    ],
)
def test_the_name_of_the_driver_is_part_of_the_condition(
    make: Callable[[], Human], variable: str, driver: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VSNBENCH_OPERATOR", variable)
    card = make().card
    assert (card.name, card.settings, card.weights_label) == ("human", {"driver": driver}, f"driver {driver}")
    assert card.identity != Human("somebody else").card.identity


@pytest.mark.parametrize(("name", "code"), [("", "no-driver"), ("x" * 61, "invalid-driver")])
def test_a_driver_needs_a_name_of_reasonable_length(name: str, code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("VSNBENCH_OPERATOR", raising=False)
    with pytest.raises(UsageError) as refusal:
        Human(name)
    assert refusal.value.code == code


def test_a_person_is_listed_and_described_like_a_model() -> None:
    for name in ("human", "human:ada"):
        described = describe_model(name)
        assert (described.name, described.where) == ("human", "vsnbench.models.human.policy:Human")
        assert described.card is not None
        assert described.card.sensors == {"rgb"}
