"""Progress as the primary metric of a study: its paired values, and the sentence about them.

The sentence never calls an arm better and never speaks of success as if it had been compared: more progress means that
the robot came nearer to its goals.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from vsnbench.report.wording import caution, compared, interval_words
from vsnbench.results.studies.entries import StudyTrialProgress
from vsnbench.statistics.clustered import Cell, arrays
from vsnbench.statistics.conclusion import Conclusion
from vsnbench.statistics.paired import PairedCell, PairedOutcomes
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


def progress_of_pair(shared: Sequence[StudyTrialProgress], pair: tuple[str, str]) -> PairedOutcomes:
    """Return the progress of two arms in the cells where both have some, as sums per cell."""
    sides = [_by_cell(shared, arm) for arm in pair]

    def cell(side: dict[tuple[str, int], list[float]], place: tuple[str, int]) -> Cell:
        return Cell(place[1], math.fsum(side[place]), len(side[place]))

    places = sorted(sides[0].keys() & sides[1].keys())
    return PairedOutcomes(tuple(PairedCell(cell(sides[0], place), cell(sides[1], place)) for place in places))


def mean_progress(outcomes: PairedOutcomes) -> tuple[float, float]:
    """Return the mean over the cells of each arm; NaN without cells."""
    if not outcomes.cells:
        return math.nan, math.nan
    first, second = (float(arrays(side.cells)[1].mean()) for side in (outcomes.first, outcomes.second))
    return first, second


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
