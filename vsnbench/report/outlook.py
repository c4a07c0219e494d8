"""What a comparison that found nothing could have found, and what would have to be driven to find more."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from vsnbench.report.pairing import Pairing
from vsnbench.statistics.clustered import Outcomes, effective_sample
from vsnbench.statistics.power import (
    design_of,
    detectable,
    fewest_starts,
    least_p,
    starts_needed,
    trials_needed,
)
from vsnbench.statistics.power_independent import (
    exchange_design_of,
    exchange_detectable,
    exchange_starts_needed,
    fewest_exchanged,
    independent_detectable,
    independent_trials_needed,
    least_exchange_p,
)

if TYPE_CHECKING:
    from vsnbench.report.summary import Summary

MOST_STARTS_NAMED = 1000


@dataclass(frozen=True, slots=True)
class Reach:
    """How small a p-value a design can give at all, whatever the outcomes."""

    paired: bool
    by_start: bool
    """Whole starting positions are dealt anew; else single trials."""
    sizes: tuple[int, int]
    """Starting positions, or trials, of the first and of the second; of a pair the same ones."""
    p: float

    def fewest(self, level: float) -> int:
        """Return how many starting positions, or trials, each model needs for a p-value below this level."""
        return fewest_starts(level) if self.paired else fewest_exchanged(level)

    def too_few(self, level: float) -> bool:
        """Whether no outcome at all could give a p-value below this level."""
        return self.p >= level

    def shortage(self, level: float) -> str:
        """Say that no difference can be found, why, and what it takes."""
        things = "starting positions" if self.by_start else "trials"
        a, b = self.sizes
        if self.paired:
            what, each = f"{a} {things}" if a != 1 else "one starting position", ""
        else:
            what, each = f"{a} against {b} {things}", " of each model"
        return (
            f"no difference can be found with so few {things}: with {what} no p-value is below {self.p:.2g}, and "
            f"{level:.2g} is asked for; it takes {self.fewest(level)}{each} at the least"
        )


def reach_of(pairing: Pairing | None, first: Outcomes, second: Outcomes, *, by_start: bool) -> Reach:
    """Return the least p-value of a design.

    Args:
        pairing: None where the samples are independent.
        first: outcomes of the first model.
        second: of the second.
        by_start: independent samples exchange whole starting positions.
    """
    if pairing:
        return Reach(paired=True, by_start=True, sizes=(pairing.starts, pairing.starts), p=least_p(pairing.starts))
    sizes = (first.clusters, second.clusters) if by_start else (_worth(first), _worth(second))
    return Reach(paired=False, by_start=by_start, sizes=sizes, p=least_exchange_p(*sizes) if all(sizes) else 1.0)


def _worth(outcomes: Outcomes) -> int:
    """Return how many independent trials outcomes are worth, whole ones."""
    return int(effective_sample(outcomes).trials + 1e-9) if outcomes.cells else 0


@dataclass(frozen=True, slots=True)
class Outlook:
    """The power of a design, at the level in force and 80 %; differences are shares."""

    level: float
    """Below which a p-value counts: 0.05 divided by the questions asked together."""
    detectable: float | None
    """The smallest difference that this design shows with 80 % power; None for none, or where that is not counted."""
    paired: bool
    trials: int
    """Paired: episodes a cell, of each model; else trials of the model that has fewer."""
    trials_needed: int | None = None
    """To show the difference seen; None where no number of them would, or nothing was seen."""
    starts: int | None = None
    """Starting positions that there are, of the model that has fewer; None where single trials are independent."""
    starts_needed: int | None = None
    """To show the difference seen; None where 1,000 would not, or nothing was seen."""
    assumed: bool = False
    """No cell was tried twice: how much repetitions resemble each other is a guess."""
    different: bool = True
    """A difference was seen."""


def outlook_of(
    pairing: Pairing | None, first: "Summary", second: "Summary", level: float, *, by_start: bool = False
) -> Outlook | None:
    """Return what the design can show; None where there is nothing to go by.

    Args:
        pairing: None where the samples are independent.
        first: of the first model.
        second: of the second.
        level: below which a p-value counts.
        by_start: independent samples exchange whole starting positions.
    """
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
            different=different,
        )
    if not first.episodes or not second.episodes:
        return None
    seen = abs(first.success_rate - second.success_rate)
    found = Outlook(
        level=level, detectable=None, paired=False, trials=min(first.episodes, second.episodes), different=seen >= 0.005
    )
    if by_start:
        apart = exchange_design_of(first.outcomes, second.outcomes, level)
        return replace(
            found,
            detectable=exchange_detectable(apart),
            starts=min(apart.starts),
            starts_needed=exchange_starts_needed(apart, seen) if found.different else None,
        )
    sizes = [max(1, round(effective_sample(each.outcomes).trials)) for each in (first, second)]
    rate = (first.success_rate + second.success_rate) / 2
    counted = max(sizes) <= _COUNTED_UP_TO
    return replace(
        found,
        detectable=independent_detectable(sizes[0], sizes[1], rate, level) if counted else None,
        trials=min(sizes),
        trials_needed=independent_trials_needed(first.success_rate, second.success_rate, level),
    )


_COUNTED_UP_TO = 400


def advice(outlook: Outlook | None, reach: Reach, level: float) -> str:
    """Say what the design can show and what would be needed, in one clause or two; empty where nothing can be said."""
    short = reach.too_few(level)
    words = [reach.shortage(level)] if short else []
    if outlook is None:
        return "; ".join(words)
    if outlook.detectable is not None and not short:
        words.append(
            f"this design shows a difference of {100 * outlook.detectable:.0f} points with 80 % power "
            f"(at p < {outlook.level:.2g})"
        )
    elif not short and outlook.starts:
        words.append(f"this design shows no difference with 80 % power (at p < {outlook.level:.2g})")
    if not outlook.different:
        words += [] if outlook.paired else ["the rates seen are equal"]
    elif outlook.starts:
        words += _starts_needed(outlook)
    elif outlook.trials_needed and (more := outlook.trials_needed - outlook.trials) > 0:
        words.append(f"one as small as that seen would need about {more} more trials a model")
    return "; ".join(words)


def _starts_needed(outlook: Outlook) -> list[str]:
    each = "" if outlook.paired else " a model"
    starts = (
        f"about {outlook.starts_needed} starting positions{each} in place of {outlook.starts}"
        if outlook.starts_needed
        else f"more than {MOST_STARTS_NAMED} starting positions{each}"
    )
    if not outlook.paired:
        return [f"one as small as that seen would need {starts}"]
    if outlook.trials_needed is None:
        return [f"one as small as that seen would need {starts}; more episodes a cell would not do"]
    guess = ", if repetitions differ about half the way" if outlook.assumed else ""
    times = f"{outlook.trials_needed} episodes a cell in place of {outlook.trials}{guess}"
    return [f"one as small as that seen would need {starts}, or {times}"]
