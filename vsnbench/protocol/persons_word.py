"""What a person's word makes of an episode: a measured distance, a collision seen, or an attempt declared void."""

import math
import re
from dataclasses import replace

from vsnbench.errors import UsageError
from vsnbench.protocol.fix import PoseSource
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict, judge
from vsnbench.protocol.parameters import ProtocolParameters

LONGEST_M = 50.0
"""No tape is longer: more than this is another unit, or a slip."""
_NUMBER = re.compile(r"(\d+(?:[.,]\d*)?|[.,]\d+)\s*(m|metres?|meters?|cm)?")


def metres(text: str, longest_m: float = LONGEST_M) -> float:
    """Return a distance that a person typed, in metres; `84 cm` is 0.84 m.

    Args:
        text: what was typed.
        longest_m: what cannot be exceeded, the extent of the site for instance.

    Raises:
        UsageError: it is no distance, or one that cannot be.
    """
    found = _NUMBER.fullmatch(text.strip().lower())
    if found is None:
        raise UsageError(f"{text!r} is no distance", advice="give metres, like 0.84")
    value = float(found[1].replace(",", ".")) * (0.01 if found[2] == "cm" else 1.0)
    if not math.isfinite(value) or value > longest_m:
        hint = f"; if you meant centimetres, write {value / 100:g}" if value / 100 <= longest_m else ""
        raise UsageError(
            f"{text.strip()} is more than the {longest_m:.0f} m that there are", advice=f"give metres, like 0.84{hint}"
        )
    return value


def taped(
    ended_with: EndReason, actions: int, distance_m: float, instance: str, parameters: ProtocolParameters
) -> Verdict:
    """Judge by a measured distance: the protocol's rule, with the tape in place of the estimate (paper, Section 4.1).

    Args:
        ended_with: why the episode ended; a tape makes no success of what did not end with STOP.
        actions: how many it had.
        distance_m: from the robot to the nearest instance that is in sight; a tape passes through no wall.
        instance: the site's id of that instance; may be empty.
        parameters: the campaign's protocol.
    """
    return judge(ended_with, actions, GoalDistance(distance_m, PoseSource.TAPE, instance), parameters)


def collided(what: str, actions: int, distance: GoalDistance | None, parameters: ProtocolParameters) -> Verdict:
    """Judge an episode in which a person saw the robot touch something that it did not feel."""
    verdict = judge(EndReason.COLLISION, actions, distance, parameters)
    return replace(verdict, text=f"{verdict.text}: {what} (seen by a person)")


def declared_void(why: str) -> Verdict:
    """Judge an attempt to be no result: the trial must be run again."""
    return Verdict(EndReason.ABORTED, None, f"void: {why}; the trial must be run again")
