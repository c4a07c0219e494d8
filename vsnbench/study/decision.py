"""State of a study that is analysed while it runs: its questions, and whether it is over."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

from vsnbench.statistics.conclusion import Conclusion
from vsnbench.study.file import NonInferiority, Rate, StudyFile

DECIDED = "the primary analysis is decided"
COMPLETE = "every block is run"
HOPELESS = "what is left could not change the answer"
"""Reasons why a study is over."""


@dataclass(frozen=True, slots=True)
class ArmQuestion:
    """One pair of arms, or an arm and a rate, with its current result."""

    first: str
    second: str | None
    """None for a fixed rate."""
    units: int
    """Number of analysed units: of bets the complete ones up to the first incomplete one, of sign flips those of the
    newest look."""
    trials: int
    """Trials of each arm in these units."""
    cells: int
    """Number of different cells of these blocks, without repetitions."""
    successes: tuple[int, int]
    """Successes in these blocks; the second is 0 for a fixed rate."""
    means: tuple[float, float]
    """Mean values of the metric over these blocks; the second is 0 for a fixed rate, both are NaN without units."""
    difference: float
    """Mean over the units of the first minus the second, or of the first's rate; NaN without units."""
    low: float
    high: float
    """Confidence sequence of bets, 1 - alpha for this question alone; repeated confidence interval of sign flips, 1 -
    alpha for all questions together. NaN where it is unknown."""
    p: float | None
    """p-value, valid at every look: of bets two-sided and for this question alone; of sign flips after Holm. None for
    sign flips against a fixed rate, which the interval decides."""
    winner: str | None
    """Better arm after Holm over all questions; for a fixed rate the arm if its rate is above."""
    decided: bool
    decided_at: int | None
    """Number of units at the decision."""
    counted: bool
    """The remaining plan cannot reverse the lead: decided by counting, without inference beyond these cells."""
    conclusion: Conclusion | None = None
    """Conclusion at the newest look of sign flips; None for bets, and before the first look."""


@dataclass(frozen=True, slots=True)
class StoppingDecision:
    """State of a study with `stopping: decided`."""

    questions: tuple[ArmQuestion, ...]
    dropped: Mapping[str, int]
    """Beaten arm -> number of units when it was dropped."""
    over: str
    """Reason to stop, or an empty string."""
    unit: str = ""
    """Kind of unit: block or starting position."""
    planned_units: int = 0
    looks: tuple[int, ...] = ()
    """Planned looks of sign flips; empty for bets."""

    @property
    def looked(self) -> tuple[int, ...]:
        """Looks that took place."""
        newest = max((question.units for question in self.questions), default=0)
        return tuple(look for look in self.looks if look <= newest)


def arm_pairs(study: StudyFile) -> list[tuple[str, str | None]]:
    """Return the pairs of arms of the primary analysis; the second is None for a fixed rate."""
    if isinstance(study.primary, Rate):
        return [(study.primary.arm, None)]
    if isinstance(study.primary, NonInferiority):
        return [(study.primary.arm, other) for other in study.arms if other != study.primary.arm]
    return [(first, second) for first, second in combinations(study.arms, 2)]
