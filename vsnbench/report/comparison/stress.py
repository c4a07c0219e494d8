"""Losses by disturbances: each condition of a stress test against the undisturbed trials of the same cells.

The rules are those of `compare`: cells are paired, intervals and tests are clustered by starting position, and the
p-values of a model are corrected after Holm for all its disturbances and severities.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from vsnbench.protocol.disturbances import Disturbance
from vsnbench.protocol.execution import CONTINUOUS
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.summary import ConditionSummary, ReportResults
from vsnbench.report.comparison.compare import SHARED, RateComparison, compare
from vsnbench.report.comparison.effects import EffectComparison
from vsnbench.report.comparison.pairing import MATCHED_BY, seeded
from vsnbench.statistics.multiple import holm

if TYPE_CHECKING:
    import pandas as pd

MOST_HARMFUL = 3
"""Number of disturbances that are listed with examples."""
EXAMPLES = 3
_MEASURES = ("SPL", "progress")
"""Measures whose losses are reported, where they exist."""
_OF_TIME = ("SCT", "driving time (s)")
"""The same for a robot that drives on while the model thinks."""


@dataclass(frozen=True, slots=True)
class StressedCampaigns:
    """Campaigns of a model in a site: without disturbances, and with each."""

    undisturbed: tuple[int, ...]
    disturbed: Mapping[Disturbance, tuple[int, ...]]
    unseen: tuple[str, ...] = ()
    """Names of disturbances that were left out because the model does not use what they change."""


@dataclass(frozen=True, slots=True)
class LostTrial:
    """A trial that succeeded undisturbed and failed disturbed."""

    goal: str
    start: int
    undisturbed: int
    """Number of the episode."""
    disturbed: int
    """Number of the episode."""


@dataclass(frozen=True, slots=True)
class Loss:
    """What a disturbance of a severity costs."""

    disturbance: Disturbance
    campaigns: tuple[int, ...]
    rate: RateComparison
    """Undisturbed is first, so that its difference is the loss."""
    effects: tuple[EffectComparison, ...]
    changed: int
    """Matched trials whose success or number of actions differs."""
    matched: int
    """Trials with a result under both conditions."""
    lost: tuple[LostTrial, ...]
    """All of them, in the order of the episodes."""


@dataclass(frozen=True, slots=True)
class Harm:
    """A disturbance over its severities."""

    name: str
    mean_loss: float
    """Mean loss in success rate over its severities."""
    examples: tuple[LostTrial, ...]
    """From the lowest severity at which trials are lost."""


@dataclass(frozen=True, slots=True)
class StressedModel:
    """The losses of one model in one site."""

    undisturbed: ConditionSummary
    losses: tuple[Loss, ...]
    unseen: tuple[str, ...] = ()
    """Names of disturbances that were left out because the model does not use what they change."""

    @property
    def untouched(self) -> tuple[str, ...]:
        """Names of disturbances under which every trial has the same success and number of actions."""
        changed = {loss.disturbance.name: False for loss in self.losses}
        for loss in self.losses:
            changed[loss.disturbance.name] |= loss.changed > 0
        return tuple(name for name, any_changed in changed.items() if not any_changed)

    @property
    def most_harmful(self) -> tuple[Harm, ...]:
        """The disturbances with the largest mean losses, at most `MOST_HARMFUL`; those without loss are left out."""
        names = dict.fromkeys(loss.disturbance.name for loss in self.losses)
        harms = sorted((self._harm(name) for name in names), key=lambda harm: -harm.mean_loss)
        return tuple(harm for harm in harms if harm.mean_loss > 0)[:MOST_HARMFUL]

    def _harm(self, name: str) -> Harm:
        own = [loss for loss in self.losses if loss.disturbance.name == name]
        known = [loss.rate.difference for loss in own if not math.isnan(loss.rate.difference)]
        examples = next((loss.lost[:EXAMPLES] for loss in own if loss.lost), ())
        return Harm(name, sum(known) / len(known) if known else 0.0, examples)


def stressed_model(record: ReportData, results: ReportResults, campaigns: StressedCampaigns) -> StressedModel | None:
    """Return the losses of one model in one site; None without undisturbed results.

    Args:
        record: the episodes of the stress test's campaigns.
        results: their summaries.
        campaigns: the campaigns of the model in the site.
    """
    by_campaign = {number: summary for summary in results.conditions for number in summary.condition.campaigns}
    undisturbed = next((by_campaign[number] for number in campaigns.undisturbed if number in by_campaign), None)
    if undisturbed is None:
        return None
    losses = []
    for disturbance, numbers in campaigns.disturbed.items():
        disturbed = next((by_campaign[number] for number in numbers if number in by_campaign), None)
        if disturbed is not None and (loss := _loss(record, results, (undisturbed, disturbed), disturbance)):
            losses.append(replace(loss, campaigns=numbers))
    adjusted = holm([loss.rate.p for loss in losses])
    corrected = (
        replace(loss, rate=replace(loss.rate, adjusted_p=p, questions=len(losses)))
        for loss, p in zip(losses, adjusted, strict=True)
    )
    return StressedModel(undisturbed, tuple(corrected), campaigns.unseen)


def _loss(
    record: ReportData,
    results: ReportResults,
    pair: tuple[ConditionSummary, ConditionSummary],
    disturbance: Disturbance,
) -> Loss | None:
    names = [summary.condition.name for summary in pair]
    comparison = compare(record, results, names, with_power=False)[0]
    rate = next((rate for rate in comparison.rates if rate.scope == SHARED), None)
    if rate is None or rate.pairing is None:
        return None
    measures = (*_MEASURES, *_OF_TIME) if disturbance.name == CONTINUOUS else _MEASURES
    effects = tuple(effect for effect in comparison.effects if effect.measure in measures)
    matched = _matched(record, pair)
    changed = (matched["success"] != matched["success_disturbed"]) | (
        matched["actions"] != matched["actions_disturbed"]
    )
    lost = matched[matched["success"] & ~matched["success_disturbed"]]
    trials = tuple(
        LostTrial(str(goal), int(start), int(undisturbed), int(disturbed))
        for goal, start, undisturbed, disturbed in zip(
            lost["goal"], lost["start"], lost["episode"], lost["episode_disturbed"], strict=True
        )
    )
    return Loss(disturbance, (), rate, effects, int(changed.sum()), len(matched), trials)


def _matched(record: ReportData, pair: Sequence[ConditionSummary]) -> "pd.DataFrame":
    """Return the trials with results under both conditions, by goal, start, seed and repetition."""
    measured = ("episode", "success", "actions")
    sides = [seeded(record.counted(summary.condition), summary.condition, measured) for summary in pair]
    joined = sides[0].merge(sides[1], on=MATCHED_BY, suffixes=("", "_disturbed"))
    return joined.sort_values("episode_disturbed")
