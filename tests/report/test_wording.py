import re

import pytest

from vsnbench.report.wording import caution, compared, interval_words, trial_count
from vsnbench.statistics.conclusion import Conclusion
from vsnbench.statistics.rates import UNKNOWN, Interval


@pytest.mark.parametrize("conclusion", Conclusion)
@pytest.mark.parametrize("margin", [0.0, 0.1])
def test_no_fragment_of_doubt_names_a_winner(conclusion: Conclusion, margin: float) -> None:
    said = caution(conclusion, margin)
    assert bool(said) == (conclusion in (Conclusion.TEST_ONLY, Conclusion.INTERVAL_ONLY))
    assert not re.search(r"better|worse|wins|ahead|significant", said)
    assert ("margin" in said) == bool(said and margin)


@pytest.mark.parametrize(
    ("trials", "cells", "said"),
    [(24, 24, "24 cells"), (150, 75, "150 trials (75 cells x 2 repetitions)"), (97, 70, "97 trials in 70 cells")],
)
def test_repetitions_are_trials_and_never_cells(trials: int, cells: int, said: str) -> None:
    assert trial_count(trials, cells) == said


def test_intervals_and_p_values() -> None:
    assert interval_words(Interval(-0.07, 0.164), 1) == "[-7.0, +16.4]"
    assert "too few starting positions" in interval_words(UNKNOWN)
    assert (compared(0.0312), compared(0.00001)) == ("= 0.031", "< 0.001")
