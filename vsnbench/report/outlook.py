"""What a comparison that found nothing could have found, and what would have to be driven to find more."""

from dataclasses import dataclass

from vsnbench.report.pairing import Pairing
from vsnbench.report.summary import Summary
from vsnbench.statistics.clustered import effective_sample
from vsnbench.statistics.power import (
    design_of,
    detectable,
    independent_detectable,
    independent_trials_needed,
    starts_needed,
    trials_needed,
)

MOST_STARTS_NAMED = 1000


@dataclass(frozen=True, slots=True)
class Outlook:
    """The power of a design, at the level in force and 80 %; differences are shares."""

    level: float
    """Below which a p-value counts: 0.05 divided by the questions asked together."""
    detectable: float | None
    """The smallest difference that this design shows with 80 % power; None for none."""
    paired: bool
    trials: int
    """Paired: episodes a cell, of each model; else trials of the model that has fewer."""
    trials_needed: int | None
    """To show the difference seen; None where 20 episodes a cell would not, or nothing was seen."""
    starts: int | None = None
    """Starting positions that there are; None where the samples are independent."""
    starts_needed: int | None = None
    """To show the difference seen; None where 1,000 would not, or nothing was seen."""
    assumed: bool = False
    """No cell was tried twice: how much repetitions resemble each other is a guess."""


def outlook_of(pairing: Pairing | None, first: Summary, second: Summary, level: float) -> Outlook | None:
    """Return what the design can show; None where there is nothing to go by."""
    if pairing:
        design, seen = design_of(pairing.outcomes, level), abs(pairing.outcomes.difference)
        different = seen >= 0.005
        return Outlook(
            level=level,
            detectable=detectable(design),
            paired=True,
            trials=design.trials,
            trials_needed=trials_needed(design, seen) if different else None,
            starts=design.starts,
            starts_needed=starts_needed(design, seen) if different else None,
            assumed=design.resemblance.assumed,
        )
    if not first.episodes or not second.episodes:
        return None
    sizes = [max(1, round(effective_sample(each.outcomes).trials)) for each in (first, second)]
    rate = (first.success_rate + second.success_rate) / 2
    counted = max(sizes) <= _COUNTED_UP_TO
    return Outlook(
        level=level,
        detectable=independent_detectable(sizes[0], sizes[1], rate, level) if counted else None,
        paired=False,
        trials=min(sizes),
        trials_needed=independent_trials_needed(first.success_rate, second.success_rate, level),
    )


_COUNTED_UP_TO = 400


def advice(outlook: Outlook | None) -> str:
    """Say what the design can show and what would be needed, in one clause or two; empty where nothing can be said."""
    if outlook is None:
        return ""
    words = []
    if outlook.detectable is not None:
        words.append(
            f"this design shows a difference of {100 * outlook.detectable:.0f} points with 80 % power "
            f"(at p < {outlook.level:.2g})"
        )
    elif outlook.paired:
        words.append(f"this design shows no difference with 80 % power (at p < {outlook.level:.2g})")
    if outlook.paired:
        words += _paired_needs(outlook)
    elif outlook.trials_needed is None:
        words.append("the rates seen are equal")
    elif more := max(0, outlook.trials_needed - outlook.trials):
        words.append(f"one as small as that seen would need about {more} more trials a model")
    return "; ".join(words)


def _paired_needs(outlook: Outlook) -> list[str]:
    if outlook.starts_needed is None and outlook.trials_needed is None:
        return []
    starts = (
        f"about {outlook.starts_needed} starting positions in place of {outlook.starts}"
        if outlook.starts_needed
        else f"more than {MOST_STARTS_NAMED} starting positions"
    )
    if outlook.trials_needed is None:
        return [f"one as small as that seen would need {starts}; more episodes a cell would not do"]
    guess = ", if repetitions differ about half the way" if outlook.assumed else ""
    times = f"{outlook.trials_needed} episodes a cell in place of {outlook.trials}{guess}"
    return [f"one as small as that seen would need {starts}, or {times}"]
