"""Sentence fragments that `compare`, `report` and `study report` print; none of them names a winner."""

from collections.abc import Iterable

from vsnbench.statistics.conclusion import Conclusion
from vsnbench.statistics.rates import Interval
from vsnbench.text.sanitize import counted


def caution(conclusion: Conclusion, margin: float = 0.0) -> str:
    """Return why no winner is named if only the test or only the interval would name one, or an empty string.

    Args:
        conclusion: conclusion about the difference.
        margin: difference that a winner must exceed.
    """
    if conclusion is Conclusion.TEST_ONLY:
        included = "differences within the margin" if margin else "0"
        return f"the test rejects equality, but the interval includes {included}"
    if conclusion is Conclusion.INTERVAL_ONLY:
        return f"the interval excludes {'the margin' if margin else '0'}, but the test does not reject equality"
    return ""


def interval_words(interval: Interval, places: int = 0) -> str:
    """Return the interval of a difference in points, or the reason why there is none."""
    if not interval.known:
        return "(too few starting positions for an interval)"
    return f"[{100 * interval.low:+.{places}f}, {100 * interval.high:+.{places}f}]"


def compared(p: float) -> str:
    """Return a p-value with its relation: `= 0.031`, `< 0.001`."""
    return f"= {p:.3f}" if p >= 0.001 else "< 0.001"


def trial_count(trials: int, cells: int) -> str:
    """Return a number of trials per arm with the number of cells: `24 cells`, `97 trials in 70 cells`.

    Repetitions of a cell count as trials, not as cells: `150 trials (75 cells x 2 repetitions)`.
    """
    if trials == cells:
        return counted(cells, "cell")
    if cells and trials % cells == 0:
        return f"{trials} trials ({counted(cells, 'cell')} x {trials // cells} repetitions)"
    return f"{counted(trials, 'trial')} in {counted(cells, 'cell')}"


def listed(items: Iterable[object]) -> str:
    """Return the items separated by commas, or `none`."""
    return ", ".join(str(item) for item in items) or "none"
