"""Questions of a report: which model succeeds more often under the same conditions."""

from collections.abc import Sequence
from dataclasses import dataclass

from vsnbench.report.analysis.comparability import circumstances
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.summary import ConditionSummary, ReportResults
from vsnbench.report.comparison.compare import SHARED, Comparison, RateComparison, compare
from vsnbench.report.comparison.ranking import RankedModel, Ranking, ranking_of
from vsnbench.report.comparison.verdicts import verdicts
from vsnbench.report.wording import listed
from vsnbench.text.sanitize import sanitize

MAX_MEMBERS = 6
"""Maximum number of models in one question, those with the most episodes; `vsnbench compare` accepts others."""


@dataclass(frozen=True, slots=True)
class ModelQuestion:
    """Several models on one robot in one site under one protocol."""

    where: str
    members: tuple[ConditionSummary, ...]
    comparisons: tuple[Comparison, ...]
    """Comparisons of all pairs of members, corrected together."""
    ranking: Ranking | None
    """Ranking of the members; None for two, or without shared goals."""
    not_compared: tuple[str, ...]
    """Competitors that are left out, with the reason."""

    @property
    def answers(self) -> tuple[str, ...]:
        """The conclusions as sentences."""
        if self.ranking:
            return (_ranking_sentence(self.ranking),)
        return tuple(sentence for comparison in self.comparisons for sentence in _shared_verdict(comparison))

    @property
    def pairs(self) -> tuple[tuple[Comparison, RateComparison], ...]:
        """Every pair with its comparison on the shared goals."""
        return tuple(
            (comparison, rate) for comparison in self.comparisons for rate in comparison.rates if rate.scope == SHARED
        )


def questions(record: ReportData, results: ReportResults) -> tuple[ModelQuestion, ...]:
    """Return one question for each group of at least two models tested under the same conditions.

    The power of designs that found nothing is left to `vsnbench compare`.
    """
    groups: dict[str, list[ConditionSummary]] = {}
    for summary in results.conditions:
        if not summary.condition.not_competing:
            groups.setdefault(circumstances(summary.condition), []).append(summary)
    found = []
    for group in groups.values():
        enough = sorted(
            (summary for summary in group if summary.is_competitor), key=lambda summary: -summary.total.episodes
        )
        members = sorted(enough[:MAX_MEMBERS], key=lambda summary: summary.condition.number)
        if len(members) < 2:
            continue
        comparisons = compare(record, results, [summary.condition.name for summary in members], with_power=False)
        first = members[0].condition
        not_compared = [
            f"{sanitize(summary.condition.name)}: {summary.shortcoming}" for summary in group if summary.shortcoming
        ]
        not_compared += [
            f"{sanitize(summary.condition.name)}: use `vsnbench compare`" for summary in enough[MAX_MEMBERS:]
        ]
        found.append(
            ModelQuestion(
                where=f"{sanitize(first.robot_title or first.robot)}, {first.environment}, in {sanitize(first.site)}",
                members=tuple(members),
                comparisons=comparisons,
                ranking=ranking_of(members, comparisons),
                not_compared=tuple(not_compared),
            )
        )
    return tuple(sorted(found, key=lambda question: question.members[0].condition.simulated))


def _ranking_sentence(ranking: Ranking) -> str:
    first, *others = ranking.models
    worse = [model for model in others if not set(model.letters) & set(first.letters)]
    undecided = [model for model in others if model not in worse]
    interval = f"[{100 * first.interval.low:.1f}, {100 * first.interval.high:.1f}]"
    tied = [sanitize(model.condition.name) for model in others if model.proportion.rate == first.proportion.rate]
    name = sanitize(first.condition.name)
    lead = f"{', '.join([name, *tied[:-1]])} and {tied[-1]} have" if tied else f"{name} has"
    clauses = [f"{lead} the highest success rate, {100 * first.proportion.rate:.1f} % {interval}"]
    if worse:
        clauses.append(f"{name if tied else 'it'} succeeds more often than {_named(worse)}")
    if undecided:
        clauses.append(f"no difference from {_named(undecided)} was shown at this number of trials")
    return (
        f"On {listed(sanitize(goal) for goal in ranking.goals)}: {'; '.join(clauses)} "
        f"(all pairs, Holm-corrected for {ranking.pairs} comparisons)."
    )


def _named(models: Sequence[RankedModel]) -> str:
    names = [f"{sanitize(model.condition.name)} ({100 * model.proportion.rate:.1f} %)" for model in models]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _shared_verdict(comparison: Comparison) -> tuple[str, ...]:
    pairs = zip(comparison.rates, verdicts(comparison), strict=True)
    return tuple(verdict for rate, verdict in pairs if rate.scope == SHARED)
