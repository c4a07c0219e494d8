"""Power of a comparison: smallest p-value, detectable difference, and trials needed."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from vsnbench.report.comparison.pairing import Pairing
from vsnbench.statistics.clustered import Outcomes, effective_sample
from vsnbench.statistics.power import design_of, detectable, least_p, min_starts, starts_needed, trials_needed
from vsnbench.statistics.power_independent import (
    exchange_design_of,
    exchange_detectable,
    exchange_starts_needed,
    independent_detectable,
    independent_trials_needed,
    least_exchange_p,
    min_exchanged_starts,
)

if TYPE_CHECKING:
    from vsnbench.report.analysis.summary import Group

MAX_NAMED_STARTS = 1000


@dataclass(frozen=True, slots=True)
class AttainableP:
    """Smallest p-value that a design can give, whatever the outcomes."""

    paired: bool
    by_start: bool
    """Whole starting positions are exchanged instead of single trials."""
    sizes: tuple[int, int]
    """Starting positions or trials of each condition; equal if paired."""
    p: float

    def min_size(self, level: float) -> int:
        """Return the starting positions or trials per model that allow a p-value below this level."""
        return min_starts(level) if self.paired else min_exchanged_starts(level)

    def too_few(self, level: float) -> bool:
        """Whether no outcome could give a p-value below this level."""
        return self.p >= level

    def shortage(self, level: float) -> str:
        """Return a sentence that no difference can be found, the reason, and the size needed."""
        units = "starting positions" if self.by_start else "trials"
        a, b = self.sizes
        if self.paired:
            size, per_model = f"{a} {units}" if a != 1 else "one starting position", ""
        else:
            size, per_model = f"{a} and {b} {units}", " per model"
        return (
            f"there are too few {units} to find any difference: with {size} the smallest possible p-value is "
            f"{self.p:.2g} and must be below {level:.2g}; at least {self.min_size(level)}{per_model} are needed"
        )


def attainable_p(pairing: Pairing | None, first: Outcomes, second: Outcomes, *, by_start: bool) -> AttainableP:
    """Return the smallest p-value of a design.

    Args:
        pairing: None for independent samples.
        first: outcomes of the first model.
        second: outcomes of the second model.
        by_start: independent samples exchange whole starting positions.
    """
    if pairing:
        return AttainableP(
            paired=True, by_start=True, sizes=(pairing.starts, pairing.starts), p=least_p(pairing.starts)
        )
    sizes = (first.clusters, second.clusters) if by_start else (_effective_trials(first), _effective_trials(second))
    return AttainableP(paired=False, by_start=by_start, sizes=sizes, p=least_exchange_p(*sizes) if all(sizes) else 1.0)


def _effective_trials(outcomes: Outcomes) -> int:
    """Return the effective number of independent trials, rounded down."""
    return int(effective_sample(outcomes).trials + 1e-9) if outcomes.cells else 0


@dataclass(frozen=True, slots=True)
class DesignPower:
    """Power of a design at the level in force, for 80 % power; differences are from 0 to 1."""

    level: float
    """Significance level: 0.05 divided by the number of comparisons."""
    detectable: float | None
    """Smallest difference found with 80 % power; None if there is none or it is not computed."""
    paired: bool
    trials: int
    """Paired: episodes per cell and model; otherwise trials of the model with fewer."""
    trials_needed: int | None = None
    """Trials needed for the observed difference; None if no number suffices or there is no difference."""
    starts: int | None = None
    """Starting positions of the model with fewer; None for independent trials."""
    starts_needed: int | None = None
    """Starting positions needed for the observed difference; None above 1,000 or without a difference."""
    assumed: bool = False
    """No cell has repetitions, so their correlation is assumed."""
    different: bool = True
    """The observed rates differ."""


def design_power(
    pairing: Pairing | None, first: "Group", second: "Group", level: float, *, by_start: bool = False
) -> DesignPower | None:
    """Return the power of the design; None without data.

    Args:
        pairing: None for independent samples.
        first: summary of the first model.
        second: summary of the second model.
        level: significance level.
        by_start: independent samples exchange whole starting positions.
    """
    if pairing:
        design, seen = design_of(pairing.outcomes, level), abs(pairing.outcomes.difference)
        different = seen >= 0.005
        return DesignPower(
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
    found = DesignPower(
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
    sizes = [max(1, round(effective_sample(summary.outcomes).trials)) for summary in (first, second)]
    rate = (first.success_rate + second.success_rate) / 2
    counted = max(sizes) <= _COUNTED_UP_TO
    return replace(
        found,
        detectable=independent_detectable(sizes[0], sizes[1], rate, level) if counted else None,
        trials=min(sizes),
        trials_needed=independent_trials_needed(first.success_rate, second.success_rate, level),
    )


_COUNTED_UP_TO = 400


def advice(power: DesignPower | None, attainable: AttainableP, level: float) -> str:
    """Return the power of the design and the size needed, as clauses; empty if unknown."""
    short = attainable.too_few(level)
    words = [attainable.shortage(level)] if short else []
    if power is None:
        return "; ".join(words)
    if power.detectable is not None and not short:
        words.append(
            f"this design shows a difference of {100 * power.detectable:.0f} points with 80 % power "
            f"(at p < {power.level:.2g})"
        )
    elif not short and power.starts:
        words.append(f"this design shows no difference with 80 % power (at p < {power.level:.2g})")
    if not power.different:
        words += [] if power.paired else ["the observed rates are equal"]
    elif power.starts:
        words += _starts_needed(power)
    elif power.trials_needed and (more := power.trials_needed - power.trials) > 0:
        words.append(f"a difference as small as the observed one needs about {more} more trials per model")
    return "; ".join(words)


def _starts_needed(power: DesignPower) -> list[str]:
    per_model = "" if power.paired else " per model"
    starts = (
        f"about {power.starts_needed} starting positions{per_model} instead of {power.starts}"
        if power.starts_needed
        else f"more than {MAX_NAMED_STARTS} starting positions{per_model}"
    )
    needs = f"a difference as small as the observed one needs {starts}"
    if not power.paired:
        return [needs]
    if power.trials_needed is None:
        return [f"{needs}; more episodes per cell are not sufficient"]
    assumed = ", assuming a correlation of 0.5 between repetitions" if power.assumed else ""
    return [f"{needs}, or {power.trials_needed} episodes per cell instead of {power.trials}{assumed}"]
