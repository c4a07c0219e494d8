"""Studies on progress: analysis of complete and decided plans, and claims they must not make."""

import re

import pytest

from tests.report.study.test_primary import SHOWN, standing
from tests.study.studies import small_study
from vsnbench.report.study.conclusion import conclusion
from vsnbench.report.study.primary import analyse, in_order
from vsnbench.statistics.conclusion import Conclusion
from vsnbench.study.file import StudyFile


def study(**changes: object) -> StudyFile:
    return small_study(**({"primary": {"metric": "progress"}} | changes))


def trials(plan: StudyFile, progress: dict[str, float | None], starts: int = 15) -> list:
    """Return failed trials with the progress of their arm, slightly larger at later positions."""
    from dataclasses import replace

    return [
        replace(
            trial,
            progress=None
            if (value := progress[trial.arm]) is None
            else min(1.0, value + 0.1 * (trial.trial.start % 3) * (trial.arm == "one")),
        )
        for trial in standing(plan, starts, lambda _arm, _goal, _start: False)
    ]


DECIDED = {"stopping": "decided", "about": "these-cells"}


@pytest.mark.parametrize("changes", [{}, DECIDED])
def test_more_progress_is_stated_as_that_and_never_as_success(changes: dict[str, str]) -> None:
    plan = study(**changes)
    primary = analyse(plan, trials(plan, {"one": 0.7, "two": 0.1}))
    (answer,) = primary.answers
    assert (answer.winner, answer.metric, answer.conclusion) == ("one", "progress", Conclusion.FIRST_BETTER)
    assert answer.means == pytest.approx((0.8, 0.1), abs=0.03)
    assert answer.low < answer.difference < answer.high
    words = conclusion(plan, primary, SHOWN, None)
    assert words.startswith(f"Arm B {'made' if changes else 'makes'} more progress than arm A")
    assert "success was not compared: 0 against 0" in words
    assert ("whether a model is better is not shown" in words) == bool(changes)
    assert not re.search(r"better than|succeeds|success rate|wins", words)


def test_no_difference_in_progress_is_no_statement_about_success() -> None:
    plan = study()
    words = conclusion(plan, analyse(plan, trials(plan, {"one": 0.4, "two": 0.5})), SHOWN, None)
    assert "o difference in progress was shown" in words
    assert not re.search(r"better|succeeds|success rate", words)


def test_arms_in_the_order_of_their_codes_keep_their_means() -> None:
    plan = study()
    turned = in_order(analyse(plan, trials(plan, {"one": 0.7, "two": 0.1})), {"one": "B", "two": "A"})
    (answer,) = turned.answers
    assert (answer.first, answer.winner) == ("two", "one")
    assert answer.means is not None
    assert answer.means[0] < answer.means[1]
    assert answer.difference < 0


def test_trials_without_progress_are_left_out_of_a_plan_and_hold_up_a_decided_study() -> None:
    plan = study()
    without = analyse(plan, trials(plan, {"one": 0.7, "two": None}))
    assert without.answers[0].conclusion is Conclusion.INCOMPLETE
    decided = study(**DECIDED)
    (answer,) = analyse(decided, trials(decided, {"one": 0.7, "two": None})).answers
    assert (answer.units, answer.winner) == (0, None)
