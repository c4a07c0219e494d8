"""The words of upstream's service name the same movements in both directions."""

import math

import pytest

from vsnbench.ros.ros1.service_words import movement_named, words_of
from vsnbench.values.movement import STOP, Move, Waypoint


@pytest.mark.parametrize(
    ("word", "angle_deg", "movement"),
    [
        ("Forward", 0, Move(0.25, holds_heading=True)),
        ("Backward", 0, Move(-0.25, holds_heading=True)),
        ("Left", 30, Move(turn_rad=math.radians(30), holds_heading=True)),
        ("Right", 360, Move(turn_rad=-math.tau, holds_heading=True)),
        ("Stop", 0, STOP),
    ],
)
def test_a_word_names_a_movement_and_back(word: str, angle_deg: int, movement: Move) -> None:
    assert movement_named(word, angle_deg, 0.25) == movement
    assert words_of(movement) == (word, angle_deg)


def test_a_turn_of_zero_degrees_turns_nothing() -> None:
    assert movement_named("Left", 0, 0.25) == movement_named("Right", 0, 0.25) == STOP


@pytest.mark.parametrize(("word", "angle_deg"), [("Jump", 0), ("forward", 0), ("", 0), ("Left", -30), ("Right", 400)])
def test_an_invalid_request_is_refused(word: str, angle_deg: int) -> None:
    with pytest.raises(ValueError, match=r"movement|angle"):
        movement_named(word, angle_deg, 0.25)


@pytest.mark.parametrize("movement", [Move(0.25), Move(0.25, 0.5, holds_heading=True), Waypoint(1.0, 0.0)])
def test_other_movements_have_no_word(movement: Move | Waypoint) -> None:
    assert words_of(movement) is None
