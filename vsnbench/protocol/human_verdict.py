"""Verdicts from an operator's statement: a measured distance, an observed collision, a void attempt."""

import math
import re
from dataclasses import replace

from vsnbench.errors import UsageError
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict, is_region, judge
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.values.fix import PoseSource

LONGEST_M = 50.0
"""Maximum length of a tape measure; a longer distance is a wrong unit or a typing error."""
_NUMBER = re.compile(r"(\d+(?:[.,]\d*)?|[.,]\d+)\s*(m|metres?|meters?|cm)?")


def metres(text: str, longest_m: float = LONGEST_M) -> float:
    """Return a typed distance in metres; `84 cm` is 0.84 m.

    Args:
        text: the typed text.
        longest_m: maximum distance, for instance the extent of the site.

    Raises:
        UsageError: the text is not a distance, or exceeds the maximum (`invalid-distance`).
    """
    found = _NUMBER.fullmatch(text.strip().lower())
    if found is None:
        raise UsageError(f"{text!r} is not a distance", advice="give metres, like 0.84", code="invalid-distance")
    value = float(found[1].replace(",", ".")) * (0.01 if found[2] == "cm" else 1.0)
    if not math.isfinite(value) or value > longest_m:
        hint = f"; if you meant centimetres, write {value / 100:g}" if value / 100 <= longest_m else ""
        raise UsageError(
            f"{text.strip()} is more than the maximum of {longest_m:.0f} m",
            advice=f"give metres, like 0.84{hint}",
            code="invalid-distance",
        )
    return value


def taped(
    ended_with: EndReason, actions: int, distance_m: float, instance: str, parameters: ProtocolParameters
) -> Verdict:
    """Judge by a distance from a tape measure: the same rule as for an estimate (paper, Section 4.1).

    Args:
        ended_with: reason of the episode's end; only STOP can succeed.
        actions: number of actions.
        distance_m: from the robot to the nearest target in sight; 0 inside a region.
        instance: the site's id of this target; may be empty.
        parameters: the campaign's protocol.
    """
    counts = distance_m <= 0 or not is_region(instance)
    return judge(ended_with, actions, GoalDistance(distance_m, PoseSource.TAPE, instance, counts), parameters)


def collided(what: str, actions: int, distance: GoalDistance | None, parameters: ProtocolParameters) -> Verdict:
    """Judge an episode with a collision that the operator saw and the robot did not report."""
    verdict = judge(EndReason.COLLISION, actions, distance, parameters)
    return replace(verdict, text=f"{verdict.text}: {what} (seen by a person)")


def declared_void(why: str) -> Verdict:
    """Declare an attempt void: the trial must be run again."""
    return Verdict(EndReason.ABORTED, None, f"void: {why}; the trial must be run again")
