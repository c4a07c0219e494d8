import pytest

from vsnbench.errors import UsageError
from vsnbench.protocol.fix import PoseSource
from vsnbench.protocol.judge import EndReason, GoalDistance
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.persons_word import collided, declared_void, metres, taped

PAPER = ProtocolParameters()


@pytest.mark.parametrize(
    ("typed", "value"),
    [("0.84", 0.84), ("0,84", 0.84), (" 1 m ", 1.0), ("84 cm", 0.84), (".5", 0.5), ("2 metres", 2.0), ("0", 0.0)],
)
def test_a_distance_is_read_in_metres(typed: str, value: float) -> None:
    assert metres(typed) == pytest.approx(value)


@pytest.mark.parametrize("typed", ["84", "-1", "about a metre", "", "nan", "inf", "1e3", "0.84 ft", "1.2.3"])
def test_what_is_no_distance_in_metres_is_refused_in_words_that_say_metres(typed: str) -> None:
    with pytest.raises(UsageError, match=r"give metres, like 0\.84"):
        metres(typed)


def test_centimetres_are_recognised_in_the_refusal() -> None:
    with pytest.raises(UsageError, match=r"more than the 12 m that there are.*centimetres, write 0\.84"):
        metres("84", longest_m=12.0)


@pytest.mark.parametrize(
    ("ended_with", "actions", "distance_m", "success"),
    [
        (EndReason.STOP, 30, 0.84, True),
        (EndReason.STOP, 30, 1.0, False),
        (EndReason.STEP_LIMIT, 150, 0.2, False),
        (EndReason.COLLISION, 30, 0.2, False),
        (EndReason.ABORTED, 30, 0.2, None),
    ],
)
def test_a_tape_is_judged_by_the_protocol(
    ended_with: EndReason, actions: int, distance_m: float, success: bool | None
) -> None:
    verdict = taped(ended_with, actions, distance_m, "chair-1", PAPER)
    assert (verdict.success, verdict.end_reason) == (success, ended_with)
    assert verdict.distance == GoalDistance(distance_m, PoseSource.TAPE, "chair-1")


def test_a_collision_that_a_person_saw_fails_whatever_the_distance() -> None:
    verdict = collided("the cat", 12, GoalDistance(0.3, PoseSource.ESTIMATED), PAPER)
    assert (verdict.end_reason, verdict.success) == (EndReason.COLLISION, False)
    assert verdict.text == "failed: collision at action 12: the cat (seen by a person)"


def test_a_declared_void_says_why() -> None:
    assert declared_void("a door was shut").text == "void: a door was shut; the trial must be run again"
    assert declared_void("a door was shut").success is None
