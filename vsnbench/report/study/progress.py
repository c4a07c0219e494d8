"""Progress as the primary metric of a study: its paired values, and the sentence about them.

The sentence never calls an arm better and never speaks of success as if it had been compared: more progress means that
the robot came nearer to its goals.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from vsnbench.report.wording import caution, compared, interval_words
from vsnbench.results.studies.entries import StudyTrialProgress
from vsnbench.statistics.conclusion import Conclusion
from vsnbench.statistics.paired_means import PairedMeans
from vsnbench.statistics.rates import Interval


@dataclass(frozen=True, slots=True)
class ProgressFinding:
    """Result of a comparison of two arms' progress, with the names to print."""

    names: tuple[str, str]
    means: tuple[float, float]
    successes: tuple[int, int]
    interval: Interval
    p: float | None
    conclusion: Conclusion
    counted: bool
    margin: float


def progress_of_pair(shared: Sequence[StudyTrialProgress], pair: tuple[str, str]) -> PairedMeans:
    """Return the mean progress of two arms in the cells where both have some."""
    first, second = (_by_cell(shared, arm) for arm in pair)
    cells = sorted(first.keys() & second.keys())
    sides = (tuple(math.fsum(side[cell]) / len(side[cell]) for cell in cells) for side in (first, second))
    return PairedMeans(tuple(start for _, start in cells), *sides)


def _by_cell(shared: Sequence[StudyTrialProgress], arm: str) -> dict[tuple[str, int], list[float]]:
    found: dict[tuple[str, int], list[float]] = {}
    for trial in shared:
        if trial.arm == arm and trial.success is not None and trial.progress is not None:
            found.setdefault((trial.trial.goal, trial.trial.start), []).append(trial.progress)
    return found


def progress_sentence(found: ProgressFinding, tried: str, where: str) -> str:
    """Return the conclusion about one pair.

    Args:
        found: the comparison.
        tried: trials of each arm, such as `75 cells`.
        where: what the conclusion covers.
    """
    (first, second), (mine, theirs) = found.names, found.means
    difference = 100 * (mine - theirs)
    interval = f"{difference:+.0f} points {interval_words(found.interval)}"
    success = f"success was not compared: {found.successes[0]} against {found.successes[1]} of {tried}"
    if found.conclusion.names_winner:
        nearer, other = (first, second) if found.conclusion.sign > 0 else (second, first)
        numbers = sorted((mine, theirs), reverse=True)
        return (
            f"{nearer} makes more progress than {other} {where}: {numbers[0]:.0%} against {numbers[1]:.0%} of the way "
            f"on average ({first} - {second}: {interval}); {success}"
        )
    if found.counted:
        return (
            f"{first} and {second} covered {mine:.0%} and {theirs:.0%} of the way; the remaining trials cannot reverse "
            f"this lead, but no test showed a difference in progress; {success}"
        )
    if doubt := caution(found.conclusion, found.margin):
        interval += f"; {doubt}" + (f", p {compared(found.p)}" if found.p is not None else "")
    return (
        f"no difference in progress was shown between {first} and {second} {where} ({interval}); this does not show "
        f"that they are equal; {success}"
    )
