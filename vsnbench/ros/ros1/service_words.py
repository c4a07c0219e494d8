"""The words of upstream's service discrete_move (paper, Section 3.1.3), and the movements that they name.

Only this service has them: every other part of vsnbench passes the movement itself.
"""

import math
from collections.abc import Mapping

from vsnbench.values.movement import STOP, Drive, Move

_WORDS: Mapping[str, tuple[int, int]] = {
    "Forward": (1, 0),
    "Backward": (-1, 0),
    "Left": (0, 1),
    "Right": (0, -1),
    "Stop": (0, 0),
}
"""Directions by word: forwards, and to the left."""


def movement_named(word: str, angle_deg: int, forward_m: float) -> Move:
    """Return the movement that a request names.

    Args:
        word: a word of the service.
        angle_deg: angle of a turn; 0 for no turn.
        forward_m: distance of a move.

    Raises:
        ValueError: the word is unknown, or the angle is invalid.
    """
    if word not in _WORDS:
        raise ValueError(f"unknown movement {word!r}: use one of {', '.join(_WORDS)}")
    ahead, left = _WORDS[word]
    if left and not 0 <= angle_deg <= 360:
        raise ValueError(f"{word} {angle_deg}: the angle of a turn must be 0 to 360 degrees")
    turn_rad = left * math.radians(angle_deg) if left else 0.0
    return Move(ahead * forward_m, turn_rad, holds_heading=True) if ahead or turn_rad else STOP


def words_of(movement: Drive) -> tuple[str, int] | None:
    """Return the word and the angle in degrees that name an action; None for a movement with parameters."""
    if not isinstance(movement, Move) or not movement.holds_heading:
        return None
    directions = _sign(movement.distance_m), _sign(movement.turn_rad)
    word = next((word for word, named in _WORDS.items() if named == directions), None)
    return None if word is None else (word, round(math.degrees(abs(movement.turn_rad))))


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)
