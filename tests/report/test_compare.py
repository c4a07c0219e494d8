"""Comparisons: paired where the design allows it, in plain words, and without a winner while trials are missing."""

from pathlib import Path

import pytest

from tests.report.records import Attempt, Lab
from vsnbench.database.records import PlannedTrial
from vsnbench.errors import UsageError
from vsnbench.report.build import read
from vsnbench.report.compare import Comparison, compare
from vsnbench.report.comparison_tables import comparison_fields, comparison_sheets
from vsnbench.report.published import published_results
from vsnbench.report.record import Selection, empty_record
from vsnbench.report.reference_tables import reference_comparison
from vsnbench.report.summary import summarise

GOALS = ("chair", "bed")
STARTS = range(1, 16)


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    return Lab(tmp_path)


def succeed(lab: Lab, model: str, successes: set[tuple[str, int]], **options: object) -> None:
    """Write one attempt a cell; those of `successes` succeed."""
    cells = [(goal, start) for goal in GOALS for start in STARTS]
    lab.write([Attempt(g, s, success=(g, s) in successes) for g, s in cells], model=model, **options)  # type: ignore[arg-type]


def comparisons(lab: Lab, *names: str, by_goal: bool = False) -> tuple[Comparison, ...]:
    record = read(lab.url, Selection())
    return compare(record, summarise(record), names, by_goal=by_goal, published=published_results())


def test_the_papers_models_on_all_goals_and_on_the_shared_ones() -> None:
    (comparison,) = reference_comparison()
    everything, shared = comparison.rates
    assert everything.p == pytest.approx(0.278, abs=0.0005)
    assert shared.p == pytest.approx(0.833, abs=0.0005)
    assert shared.goals[0] == ("chair", "sofa", "bed", "toilet")
    assert "not distinguishable" in comparison.verdicts[0]
    assert "Their goals differ" in comparison.verdicts[0]
    # 437 trials a model are needed for 29.33 against 21.11 %; 75 are there.
    assert "about 362 more trials a model" in comparison.verdicts[0]


def test_trials_of_one_site_are_paired(lab: Lab) -> None:
    succeed(lab, "a", {("chair", start) for start in range(1, 11)})
    succeed(lab, "b", {("chair", start) for start in range(9, 13)})
    (comparison,) = comparisons(lab, "a", "b")
    (rate,) = comparison.rates
    assert rate.paired is not None
    assert (rate.paired.pairs, rate.paired.only_first, rate.paired.only_second) == (30, 8, 2)
    # By hand: 2 * (1 + 10 + 45) / 2**10.
    assert rate.p == pytest.approx(112 / 1024)
    assert 0 < rate.paired.permutation_p < 1


def test_a_clear_difference_has_a_winner(lab: Lab) -> None:
    succeed(lab, "good", {(g, s) for g in GOALS for s in STARTS})
    succeed(lab, "bad", set())
    (comparison,) = comparisons(lab, "bad", "good")
    assert "good succeeds more often than bad" in comparison.verdicts[0]
    assert comparison_fields(comparison)["rates"][0]["significant"] is True


def test_no_winner_is_named_below_95_percent_coverage(lab: Lab) -> None:
    succeed(lab, "good", {(g, s) for g in GOALS for s in STARTS})
    planned = [PlannedTrial(g, s) for g in GOALS for s in STARTS]
    done = [Attempt(t.goal, t.start, success=False) for t in planned[:28]]
    lab.write(done, model="bad", trials=planned)
    (comparison,) = comparisons(lab, "good", "bad")
    assert "No winner is named: only 28 of 30 trials of bad are done" in comparison.verdicts[0]
    assert "more often" not in comparison.verdicts[0]
    assert comparison_fields(comparison)["rates"][0]["significant"] is False


def test_other_sites_are_not_paired(lab: Lab) -> None:
    succeed(lab, "a", {("chair", 1)})
    other = Lab(lab.directory, lab.site.model_copy(update={"name": "twin"}))
    succeed(other, "b", {("chair", 2)})
    (comparison,) = comparisons(lab, "a", "b")
    assert comparison.rates[0].paired is None
    assert comparison.rates[0].p == 1.0


def test_several_questions_are_corrected_together(lab: Lab) -> None:
    succeed(lab, "a", {("chair", s) for s in STARTS})
    succeed(lab, "b", {("bed", s) for s in range(1, 4)})
    succeed(lab, "c", set())
    found = comparisons(lab, "a", "b", "c", by_goal=True)
    assert [one.asked for one in found] == [9, 9, 9]  # three pairs, on the shared goals and on each of two
    for one in found:
        for rate in one.rates:
            assert rate.p <= rate.adjusted_p <= 1
    assert "after Holm's correction for 9 questions" in found[0].verdicts[0]


def test_effects_are_resampled_by_starting_position(lab: Lab) -> None:
    lab.write([Attempt(g, s, actions=40 + s) for g in GOALS for s in STARTS], model="slow")
    lab.write([Attempt(g, s, actions=20 + s) for g in GOALS for s in STARTS], model="fast")
    (comparison,) = comparisons(lab, "slow", "fast")
    actions = comparison.effects[0]
    # Every position is 20 actions slower: drawing positions for both together leaves nothing to vary.
    assert (actions.difference, actions.interval.low, actions.interval.high) == pytest.approx((20, 20, 20))


def test_the_paper_can_be_compared_with(lab: Lab) -> None:
    succeed(lab, "vlv", {("chair", 1)})
    (comparison,) = comparisons(lab, "vlv", "paper:vlv")
    assert [rate.scope for rate in comparison.rates] == ["all goals", "shared goals"]
    assert comparison.rates[1].second.episodes == 30
    assert comparison.effects == ()


def test_an_upper_bound_is_called_one(lab: Lab) -> None:
    succeed(lab, "oracle", {(g, s) for g in GOALS for s in STARTS}, surveyed=True)
    succeed(lab, "b", set())
    (comparison,) = comparisons(lab, "oracle", "b")
    assert "oracle is handed the site: an upper bound, not a competitor" in comparison.verdicts[0]


def test_names_that_fit_nothing_or_several_are_explained(lab: Lab) -> None:
    succeed(lab, "a", set())
    succeed(lab, "a", set(), simulated=False)
    with pytest.raises(UsageError, match="under several conditions, name one of them: 'a simulated', 'a real'"):
        comparisons(lab, "a", "paper:vlv")
    with pytest.raises(UsageError, match="no results of 'b'"):
        comparisons(lab, "a real", "b")
    with pytest.raises(UsageError, match="paper has no model 'dqn'"):
        comparisons(lab, "a real", "paper:dqn")
    with pytest.raises(UsageError, match="named twice"):
        comparisons(lab, "a real", "a real")
    with pytest.raises(UsageError, match="at least two"):
        comparisons(lab, "a real")
    assert len(comparisons(lab, "a real", "a simulated")) == 1


def test_the_sheets_leave_out_what_the_design_does_not_have() -> None:
    record = empty_record()
    (comparison,) = compare(record, published_results(), ["paper:vlv", "paper:pirlnav"], published=published_results())
    (sheet,) = comparison_sheets(comparison)
    headings = [column.heading for column in sheet.columns]
    assert "Fisher p" in headings
    assert "McNemar p" not in headings
