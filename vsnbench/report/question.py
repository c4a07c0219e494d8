"""The question that a report is read for: which model succeeds more often in the same circumstances, and how sure."""

from collections.abc import Sequence
from dataclasses import dataclass

from vsnbench.harmless_text import harmless
from vsnbench.report.compare import SHARED, Comparison, RateComparison, compare
from vsnbench.report.contest import Contest, Standing, contest_of
from vsnbench.report.peers import circumstances, is_competitor, shortcoming
from vsnbench.report.record import Record
from vsnbench.report.sheets import listed
from vsnbench.report.summary import ConditionSummary, Results
from vsnbench.report.verdicts import verdicts

MOST_MEMBERS = 6
"""Models that one question is about, those with the most episodes; `vsnbench compare` takes any others."""


@dataclass(frozen=True, slots=True)
class Question:
    """Several models on one robot in one site under one protocol."""

    where: str
    members: tuple[ConditionSummary, ...]
    comparisons: tuple[Comparison, ...]
    """Of every pair of members, corrected together."""
    contest: Contest | None
    """All of them at once; None for two, or where no goal is shared."""
    not_asked: tuple[str, ...]
    """Competitors that are left out, each with the reason."""

    @property
    def answers(self) -> tuple[str, ...]:
        """Who is better and how sure that is, in plain sentences."""
        if self.contest:
            return (_led(self.contest),)
        return tuple(sentence for one in self.comparisons for sentence in _shared_verdict(one))

    @property
    def pairs(self) -> tuple[tuple[Comparison, RateComparison], ...]:
        """Every pair with its comparison on the goals that both were asked for."""
        return tuple((one, rate) for one in self.comparisons for rate in one.rates if rate.scope == SHARED)


def questions(record: Record, results: Results) -> tuple[Question, ...]:
    """Ask, wherever two models or more were tested in the same circumstances, which of them succeeds more often.

    Designs that found nothing are not asked what they could have found: `vsnbench compare` does that, in its own time.
    """
    groups: dict[str, list[ConditionSummary]] = {}
    for one in results.conditions:
        if not one.condition.surveyed:
            groups.setdefault(circumstances(one.condition), []).append(one)
    found = []
    for group in groups.values():
        enough = sorted(filter(is_competitor, group), key=lambda one: -one.total.episodes)
        members = sorted(enough[:MOST_MEMBERS], key=lambda one: one.condition.number)
        if len(members) < 2:
            continue
        comparisons = compare(record, results, [one.condition.name for one in members], outlooks=False)
        first = members[0].condition
        not_asked = [f"{harmless(one.condition.name)}: {why}" for one in group if (why := shortcoming(one))]
        not_asked += [f"{harmless(one.condition.name)}: `vsnbench compare` takes it" for one in enough[MOST_MEMBERS:]]
        found.append(
            Question(
                where=f"{harmless(first.robot_title or first.robot)}, {first.environment}, in {harmless(first.site)}",
                members=tuple(members),
                comparisons=comparisons,
                contest=contest_of(members, comparisons),
                not_asked=tuple(not_asked),
            )
        )
    return tuple(sorted(found, key=lambda one: one.members[0].condition.simulated))


def _led(contest: Contest) -> str:
    first, *others = contest.standings
    behind = [one for one in others if not set(one.letters) & set(first.letters)]
    beside = [one for one in others if one not in behind]
    best = (
        f"{harmless(first.condition.name)} has the highest success rate, {100 * first.proportion.rate:.1f} % "
        f"[{100 * first.interval.low:.1f}, {100 * first.interval.high:.1f}]"
    )
    words = [best]
    if behind:
        words.append(f"it succeeds more often than {_named(behind)}")
    if beside:
        words.append(f"it cannot be told apart from {_named(beside)} at this number of trials")
    return (
        f"On {listed(harmless(goal) for goal in contest.goals)}: {'; '.join(words)} "
        f"(all pairs, corrected after Holm for {contest.pairs} questions)."
    )


def _named(standings: Sequence[Standing]) -> str:
    names = [f"{harmless(one.condition.name)} ({100 * one.proportion.rate:.1f} %)" for one in standings]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _shared_verdict(comparison: Comparison) -> tuple[str, ...]:
    said = zip(comparison.rates, verdicts(comparison), strict=True)
    return tuple(words for rate, words in said if rate.scope == SHARED)
