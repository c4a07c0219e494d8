"""Comparisons: paired if the design allows it, in plain words, no winner while trials are missing."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from tests.report.records import Attempt, Lab
from tests.report.study.test_primary import standing
from tests.study.studies import small_study
from vsnbench.errors import UsageError
from vsnbench.report.analysis.comparability import kinds_note
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.episodes_frame import empty_report_data
from vsnbench.report.analysis.published import published_results
from vsnbench.report.analysis.summary import ReportResults, summarise
from vsnbench.report.build import read
from vsnbench.report.comparison.compare import EXCHANGED, Comparison, compare
from vsnbench.report.comparison.ranking import ranking_of
from vsnbench.report.comparison.verdicts import verdicts
from vsnbench.report.study.primary import analyse
from vsnbench.report.tables.comparison import COMPARISON, comparison_tables
from vsnbench.report.tables.ranking import ranking_table
from vsnbench.report.tables.reference import reference_comparison
from vsnbench.results.writing.campaigns import Trial
from vsnbench.sites.site import load_site
from vsnbench.statistics.clustered import independent_difference
from vsnbench.statistics.conclusion import Conclusion

GOALS = ("chair", "bed")
STARTS = range(1, 16)


def succeed(lab: Lab, model: str, successes: set[tuple[str, int]], **options: object) -> None:
    """Write an attempt for each cell; those in `successes` succeed."""
    cells = [(goal, start) for goal in GOALS for start in STARTS]
    lab.write([Attempt(g, s, success=(g, s) in successes) for g, s in cells], model=model, **options)  # type: ignore[arg-type]


def results_of(lab: Lab) -> ReportResults:
    return summarise(read(lab.url, Selection()))


def comparisons(lab: Lab, *names: str, by_goal: bool = False) -> tuple[Comparison, ...]:
    record = read(lab.url, Selection())
    return compare(record, summarise(record), names, by_goal=by_goal, published=published_results())


def test_the_papers_models_on_all_goals_and_on_the_shared_ones() -> None:
    (comparison,) = reference_comparison()
    everything, shared = comparison.rates
    assert everything.p == pytest.approx(0.278, abs=0.0005)
    assert shared.p == pytest.approx(0.833, abs=0.0005)
    assert shared.goals[0] == ("chair", "sofa", "bed", "toilet")
    assert "no difference shown" in verdicts(comparison)[0]
    assert "The goals differ" in verdicts(comparison)[0]
    # Fisher's test needs 461 trials per model for 29.33 against 21.11 %; the record has 75.
    assert "about 386 more trials per model" in verdicts(comparison)[0]
    assert "this design shows a difference of 20 points with 80 % power" in verdicts(comparison)[0]


def test_trials_of_one_site_are_paired(lab: Lab) -> None:
    succeed(lab, "a", {("chair", start) for start in range(1, 11)})
    succeed(lab, "b", {("chair", start) for start in range(9, 13)})
    (comparison,) = comparisons(lab, "a", "b")
    (rate,) = comparison.rates
    assert rate.pairing is not None
    assert (rate.matches.pairs, rate.matches.only_first, rate.matches.only_second) == (30, 8, 2)
    # By hand: 2 * (1 + 10 + 45) / 2**10.
    assert rate.p == pytest.approx(112 / 1024)


def one_seed_after_another(lab: Lab, model: str, outcomes: dict[int, set[int]], order: tuple[int, ...]) -> None:
    """Write a campaign of one goal for each seed in order, with the starts that succeed under the seed."""
    for seed in order:
        attempts = [Attempt("chair", start, success=start in outcomes[seed]) for start in STARTS]
        lab.write(attempts, model=model, seed=seed)


def test_the_same_outcomes_under_five_seeds_give_the_verdict_of_one(tmp_path: Path) -> None:
    found = []
    for name, seeds in (("one", (0,)), ("five", (0, 1, 2, 3, 4))):
        lab = Lab(tmp_path / name)
        lab.directory.mkdir()
        one_seed_after_another(lab, "vlv", {seed: set(range(1, 10)) for seed in seeds}, seeds)
        one_seed_after_another(lab, "pirlnav", {seed: set(range(7, 13)) for seed in seeds}, seeds)
        (comparison,) = comparisons(lab, "vlv", "pirlnav")
        found.append((comparison.rates[0], verdicts(comparison)[0], results_of(lab)))
    (one, one_said, before), (five, five_said, after) = found
    assert one.p == five.p == pytest.approx(0.5078125)  # McNemar's, 6 against 3
    assert (five.interval.low, five.interval.high) == pytest.approx((one.interval.low, one.interval.high))
    assert "9/15 against 6/15" in one_said
    assert "45/75 against 30/75 (75 episodes from 15 cells)" in five_said
    assert "no difference shown" in one_said
    assert "no difference shown" in five_said
    for mine, copied in zip(before.conditions, after.conditions, strict=True):
        assert copied.total.interval.low == pytest.approx(mine.total.interval.low)
        assert copied.total.repeats == "75 episodes from 15 cells"
        assert mine.total.repeats == ""


def test_which_seed_ran_first_changes_nothing_and_no_seed_drops_out(tmp_path: Path) -> None:
    outcomes = {0: {1, 2, 3, 4, 5}, 1: {1, 6, 7}, 2: {1, 2, 9}}
    others = {0: {4, 5}, 1: {7, 8}, 5: {3}}
    found = []
    for name, order in (("up", (0, 1, 2)), ("down", (2, 1, 0))):
        lab = Lab(tmp_path / name)
        lab.directory.mkdir()
        one_seed_after_another(lab, "a", outcomes, order)
        one_seed_after_another(lab, "b", others, tuple({0: 0, 1: 1, 2: 5}[seed] for seed in order))
        (comparison,) = comparisons(lab, "a", "b")
        found.append(comparison.rates[0])
    up, down = found
    assert up.p == down.p
    assert up.interval == down.interval
    for rate in found:
        assert rate.pairing is not None
        assert rate.matches.pairs == 30  # seeds 0 and 1
        assert [each.trials for each in rate.compared] == [45, 45]
        assert rate.difference == pytest.approx((11 - 5) / 45)


def test_what_lies_in_cells_that_only_one_was_tried_in_is_said_to_be_left_out(lab: Lab) -> None:
    lab.write([Attempt("chair", start) for start in STARTS], model="a")
    lab.write([Attempt("chair", start, success=False) for start in range(1, 13)], model="b")
    (comparison,) = comparisons(lab, "a", "b")
    (rate,) = comparison.rates
    assert [each.trials for each in rate.compared] == [12, 12]
    assert rate.difference == 1.0
    assert rate.interval.low > 0.6
    assert "Left out: 3 episodes of a in cells without" in verdicts(comparison)[0]


def test_the_interval_is_of_the_design_that_the_test_is_of(lab: Lab) -> None:
    # Nearly the same cells succeed: the paired difference is significant, the unpaired one is not.
    succeed(lab, "a", {("chair", start) for start in range(1, 14)})
    succeed(lab, "b", {("chair", start) for start in range(1, 7)})
    (comparison,) = comparisons(lab, "a", "b")
    (rate,) = comparison.rates
    assert rate.p < 0.05
    assert rate.interval.low > 0
    assert independent_difference(rate.first.outcomes, rate.second.outcomes).low < 0


def test_no_winner_is_named_while_the_interval_holds_no_difference(lab: Lab) -> None:
    # Positions are more alike than by chance: the variance is small, and exchanging them gives a small p.
    missed = {("bed", start) for start in (7, 8, 11, 15)} | {("plant", start) for start in (1, 7, 8, 9, 10, 12, 14, 15)}
    for model, goals in (("a", ("chair", "sofa", "bed")), ("b", ("chair", "plant"))):
        lab.write([Attempt(g, s, success=(g, s) not in missed) for g in goals for s in STARTS], model=model)
    (comparison,) = comparisons(lab, "a", "b")
    rate = comparison.rates[0]
    assert rate.scope == "all goals"
    assert rate.p < 0.05
    assert rate.interval.low < 0 < rate.interval.high
    assert rate.conclusion is Conclusion.TEST_ONLY
    assert "no difference shown" in verdicts(comparison)[0]
    assert "but the interval includes 0" in verdicts(comparison)[0]


def test_advice_counts_in_starting_positions_and_in_episodes_a_cell(lab: Lab) -> None:
    succeed(lab, "a", {("chair", start) for start in range(1, 9)})
    succeed(lab, "b", {("chair", start) for start in range(5, 10)})
    (comparison,) = comparisons(lab, "a", "b")
    power = comparison.rates[0].power
    assert power is not None
    assert power.detectable is not None
    assert 0.1 < power.detectable < 0.6
    assert power.starts == 15
    said = verdicts(comparison)[0]
    assert "this design shows a difference of" in said
    assert "starting positions instead of 15" in said
    assert "would have been enough" not in said


def test_a_clear_difference_has_a_winner(lab: Lab) -> None:
    succeed(lab, "good", {(g, s) for g in GOALS for s in STARTS})
    succeed(lab, "bad", set())
    (comparison,) = comparisons(lab, "bad", "good")
    assert "good succeeds more often than bad" in verdicts(comparison)[0]
    assert COMPARISON.fields(comparison)["rates"][0]["significant"] is True


def test_no_winner_is_named_below_95_percent_coverage(lab: Lab) -> None:
    succeed(lab, "good", {(g, s) for g in GOALS for s in STARTS})
    planned = [Trial(g, s) for g in GOALS for s in STARTS]
    done = [Attempt(t.goal, t.start, success=False) for t in planned[:28]]
    lab.write(done, model="bad", trials=planned)
    (comparison,) = comparisons(lab, "good", "bad")
    assert "No winner is named: only 28 of 30 trials of bad are complete" in verdicts(comparison)[0]
    assert "more often" not in verdicts(comparison)[0]
    assert COMPARISON.fields(comparison)["rates"][0]["significant"] is False


def test_other_sites_are_not_paired(lab: Lab) -> None:
    succeed(lab, "a", {("chair", 1)})
    other = Lab(lab.directory, lab.site.model_copy(update={"name": "twin"}))
    succeed(other, "b", {("chair", 2)})
    (comparison,) = comparisons(lab, "a", "b")
    assert comparison.rates[0].pairing is None
    assert comparison.rates[0].test == "permutation of starting positions"
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
    assert "after Holm's correction for 9 comparisons" in verdicts(found[0])[0]


def test_a_study_and_compare_give_the_same_answers_on_one_record(lab: Lab) -> None:
    random, rates = np.random.default_rng(3), (0.2, 0.35, 0.5, 0.55, 0.75)
    chances = {f"m{n}": rate for n, rate in enumerate(rates)}
    won = {
        name: {(goal, start) for goal in GOALS for start in STARTS if random.random() < rate}
        for name, rate in chances.items()
    }
    for name, successes in won.items():
        succeed(lab, name, successes)
    signs = []
    for names in itertools.combinations(chances, 3):
        study = small_study(arms={name: {"model": f"lab:{name}"} for name in names}, goals=list(GOALS))
        asked = analyse(study, standing(study, len(STARTS), lambda arm, goal, start: (goal, start) in won[arm]))
        for answer, compared in zip(asked.answers, comparisons(lab, *names), strict=True):
            (rate,) = compared.rates
            assert (answer.first, answer.second) == (compared.first.name, compared.second.name)
            assert (rate.interval.low, rate.interval.high) == pytest.approx((answer.low, answer.high))
            assert rate.adjusted_p == pytest.approx(answer.p)
            assert rate.conclusion is answer.conclusion
            signs.append(rate.conclusion.sign)
    assert 5 < sum(map(abs, signs)) < 25, "some pairs differ, others do not"


def test_several_models_have_a_global_test_and_letters_for_distinct_groups(lab: Lab) -> None:
    succeed(lab, "poor", {("chair", 1)})
    succeed(lab, "best", {(g, s) for g in GOALS for s in STARTS})
    succeed(lab, "fair", {("chair", s) for s in (2, 3)})
    found = comparisons(lab, "poor", "best", "fair")
    ranking = ranking_of(results_of(lab).conditions, found)
    assert ranking is not None
    assert (ranking.cells, ranking.starts, ranking.pairs) == (30, 15, 3)
    assert ranking.p is not None
    assert ranking.p < 0.001
    assert [one.condition.name for one in ranking.models] == ["best", "fair", "poor"]
    assert [one.letters for one in ranking.models] == ["a", "b", "b"]
    assert [(one.ranks.best, one.ranks.worst) for one in ranking.models] == [(1, 1), (2, 3), (2, 3)]
    table = ranking_table(ranking)
    assert [cell.text for cell in table.rows[1].cells][:3] == ["2 to 3", "fair", "2/30"]
    assert "Overall test: p < 0.001" in table.notes[0]
    assert ranking_of(results_of(lab).conditions[:2], found) is None


def test_effects_are_resampled_by_starting_position(lab: Lab) -> None:
    lab.write([Attempt(g, s, actions=40 + s) for g in GOALS for s in STARTS], model="slow")
    lab.write([Attempt(g, s, actions=20 + s + s % 2) for g in GOALS for s in STARTS], model="fast")
    (comparison,) = comparisons(lab, "slow", "fast")
    actions = comparison.effects[0]
    # Each position is 19 or 20 actions slower: resampling positions for both models together has little variance.
    assert 19 <= actions.interval.low < actions.difference < actions.interval.high <= 20


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
    assert "oracle has access to the site file: an upper bound, not a competitor" in verdicts(comparison)[0]


def test_a_person_is_called_a_reference(lab: Lab) -> None:
    succeed(lab, "human", {(g, s) for g in GOALS for s in STARTS}, settings={"driver": "ada"})
    succeed(lab, "b", set())
    (comparison,) = comparisons(lab, "human ada", "b")
    assert "human ada is a person: a reference, not a competitor" in verdicts(comparison)[0]


def test_names_that_fit_nothing_or_several_are_explained(lab: Lab) -> None:
    succeed(lab, "a", set())
    succeed(lab, "a", set(), simulated=False)
    with pytest.raises(UsageError, match="under several conditions; name one of: 'a simulated', 'a real'"):
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
    record = empty_report_data()
    (comparison,) = compare(record, published_results(), ["paper:vlv", "paper:pirlnav"], published=published_results())
    (table,) = comparison_tables(comparison)
    headings = [column.heading for column in table.columns]
    assert "p" in headings
    assert "only A : only B" not in headings


def test_of_a_design_too_small_for_any_p_value_nothing_is_concluded(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    goals = ("chair", "bed")
    lab.write([Attempt(goal, start) for goal in goals for start in (1, 2)], model="a")
    lab.write([Attempt(goal, start, success=False) for goal in goals for start in (1, 2)], model="b")
    record = read(lab.url, Selection())
    (one,) = compare(record, summarise(record), ["a", "b"])
    (rate,) = one.rates
    assert rate.p == 0.5
    (words,) = verdicts(one)
    assert "with 2 starting positions the smallest possible p-value is 0.5" in words
    assert "at least 6 are needed" in words
    assert "+100.0 points (too few starting positions for an interval)" in words
    assert "[" not in words
    assert "80 % power" not in words
    assert not any(effect.interval.known for effect in one.effects)
    fields = COMPARISON.fields(one)["rates"][0]
    assert (fields["least_p"], fields["too_few"], fields["significant"]) == (0.5, True, False)


def test_an_interval_without_0_is_no_evidence_where_no_test_can_be(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    for model, success in (("a", True), ("b", False)):
        lab.write([Attempt("chair", start, success=success) for start in (1, 2, 3)], model=model)
    record = read(lab.url, Selection())
    (one,) = compare(record, summarise(record), ["a", "b"])
    (words,) = verdicts(one)
    assert "+100.0 points [+20.6, +100.0], p = 0.250" in words
    assert words.endswith("an interval that excludes 0 is not evidence by itself.")


def test_two_positions_against_three_can_show_nothing_and_what_it_takes_is_said(tmp_path: Path) -> None:
    lab, elsewhere = Lab(tmp_path), Lab(tmp_path, load_site("apartment").model_copy(update={"name": "other"}))
    lab.write([Attempt(goal, start) for goal in ("chair", "bed") for start in (1, 2)], model="a")
    elsewhere.write(
        [Attempt(goal, start, success=False) for goal in ("chair", "bed") for start in (1, 2, 3)], model="b"
    )
    record = read(lab.url, Selection())
    (one,) = compare(record, summarise(record), ["a", "b"])
    (rate,) = one.rates
    assert rate.test == EXCHANGED
    assert rate.p == pytest.approx(0.1, abs=0.01)
    assert rate.power is not None
    assert rate.power.detectable is None
    (words,) = verdicts(one)
    assert "with 2 and 3 starting positions the smallest possible p-value is 0.1" in words
    assert "at least 4 per model are needed" in words
    assert "starting positions per model instead of 2" in words


def test_numbers_of_actions_are_compared_only_between_models_of_one_kind(lab: Lab) -> None:
    half = {("chair", start) for start in range(1, 9)}
    for model, kinds in (("turns", None), ("walks", None), ("aims", ["discrete", "waypoint"])):
        succeed(lab, model, half, settings={"action_kinds": kinds} if kinds else {})
    (same,) = comparisons(lab, "turns", "walks")
    (other,) = comparisons(lab, "turns", "aims")
    assert [effect.measure for effect in same.effects[:2]] == ["actions", "actions of successful episodes"]
    assert [e.measure for e in other.effects] == ["progress", "SPL", "SoftSPL", "SCT", "driving time (s)"]
    assert [COMPARISON.fields(each)["actions_compared"] for each in (same, other)] == [True, False]
    notes = [comparison_tables(each)[1].notes for each in (same, other)]
    assert [len(each) for each in notes] == [1, 2]
    assert "A answers with discrete, B with discrete" in notes[1][-1]
    conditions = {summary.condition.model: summary.condition for summary in results_of(lab).conditions}
    assert conditions["aims"].action_kinds == ("discrete", "waypoint")
    assert "answers: discrete, waypoint" in conditions["aims"].description
    assert "answers" not in conditions["turns"].description
    assert kinds_note([conditions["turns"], conditions["walks"]]) == ""
    assert kinds_note(conditions.values())
