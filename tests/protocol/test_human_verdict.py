import pytest

from vsnbench.errors import UsageError
from vsnbench.protocol.human_verdict import collided, declared_void, metres, taped
from vsnbench.protocol.judge import EndReason, GoalDistance
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.values.fix import PoseSource

PAPER = ProtocolParameters()


@pytest.mark.parametrize(
    ("typed", "value"),
    [("0.84", 0.84), ("0,84", 0.84), (" 1 m ", 1.0), ("84 cm", 0.84), (".5", 0.5), ("2 metres", 2.0), ("0", 0.0)],
)
def test_a_distance_is_read_in_metres(typed: str, value: float) -> None:
    assert metres(typed) == pytest.approx(value)


@pytest.mark.parametrize("typed", ["84", "-1", "about a metre", "", "nan", "inf", "1e3", "0.84 ft", "1.2.3"])
def test_invalid_distances_are_refused(typed: str) -> None:
    with pytest.raises(UsageError, match=r"give metres, like 0\.84"):
        metres(typed)


def test_centimetres_are_recognised_in_the_refusal() -> None:
    with pytest.raises(UsageError, match=r"more than the maximum of 12 m.*centimetres, write 0\.84"):
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
def test_a_taped_distance_is_judged_by_the_protocol(
    ended_with: EndReason, actions: int, distance_m: float, success: bool | None
) -> None:
    verdict = taped(ended_with, actions, distance_m, "chair-1", PAPER)
    assert (verdict.success, verdict.end_reason) == (success, ended_with)
    assert verdict.distance == GoalDistance(distance_m, PoseSource.TAPE, "chair-1")


def test_an_observed_collision_fails_at_any_distance() -> None:
    verdict = collided("the cat", 12, GoalDistance(0.3, PoseSource.ESTIMATED), PAPER)
    assert (verdict.end_reason, verdict.success) == (EndReason.COLLISION, False)
    assert verdict.text == "failed: collision at action 12: the cat (seen by a person)"


def test_a_void_attempt_has_a_reason() -> None:
    assert declared_void("a door was shut").text == "void: a door was shut; the trial must be run again"
    assert declared_void("a door was shut").success is None
