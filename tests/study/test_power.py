import numpy as np
import pytest
from scipy.stats import binom
from statsmodels.stats.power import TTestPower

from tests.study.studies import small_study
from vsnbench.statistics.balanced import flip_p_values, paired_intervals
from vsnbench.statistics.conclusion import winner_signs
from vsnbench.statistics.power import Design, Resemblance
from vsnbench.statistics.sequential.betting import as_share, capital
from vsnbench.study.power import (
    PlannedPower,
    decided_studies,
    design_of_study,
    planned_power,
    simulated_arms,
    unit_differences,
)
from vsnbench.study.stopping import decide
from vsnbench.study.units import Block

UNRELATED = Resemblance(0.0, 0.0, 0.0)


def of(found: tuple[PlannedPower, ...]) -> float:
    return found[0].power


def test_with_one_cell_a_position_power_is_that_of_mcnemars_test_counted_out() -> None:
    starts, first, second = 30, 0.75, 0.45
    design = Design(starts, 1, 1, (first + second) / 2, UNRELATED)
    for_it, against = first * (1 - second), second * (1 - first)
    exact = 0.0
    for apart in range(starts + 1):
        share = binom.pmf(apart, starts, for_it + against)
        wins = np.arange(apart + 1)
        p = np.minimum(1, 2 * binom.cdf(np.minimum(wins, apart - wins), apart, 0.5))
        exact += share * float((binom.pmf(wins, apart, for_it / (for_it + against)) * (p <= 0.05)).sum())
    assert of(planned_power(small_study(), design, (first - second,))) == pytest.approx(exact, abs=0.06)


def test_with_many_positions_power_is_that_of_statsmodels_paired_t_test() -> None:
    design = Design(200, 1, 1, 0.55, UNRELATED)
    spread = np.sqrt(0.6 * 0.4 + 0.5 * 0.5)
    expected = TTestPower().power(0.1 / spread, 200, 0.05)
    assert of(planned_power(small_study(), design, (0.1,))) == pytest.approx(expected, abs=0.06)


@pytest.mark.parametrize(("about", "difference"), [("these-cells", 0.2), ("cells-like-these", 0.5)])
@pytest.mark.parametrize("repetitions", [1, 2])
def test_simulated_studies_end_as_the_study_itself_would(about: str, difference: float, repetitions: int) -> None:
    study = small_study(stopping="decided", about=about, starting_positions="1-12", repetitions=repetitions)
    random = np.random.default_rng(2)
    design = Design(12, 2, repetitions, 0.5, Resemblance(0.2, 0.4, 0.3))
    arms = simulated_arms(random, design, difference, samples=40)
    by_start = about == "cells-like-these"
    found = decided_studies(unit_differences(arms, by_start=by_start), 0.05, 0.0, by_start=by_start)
    assert 5 < np.count_nonzero(found.signs) < 40
    for place in range(40):
        wins, losses = arms[:, place].astype(bool)
        blocks = [
            Block(study.goals[at[1]], at[0] + 1, {"one": bool(wins[at]), "two": bool(losses[at])})
            for at in np.ndindex(wins.shape)
        ]
        question = decide(study, blocks).questions[0]
        winner = question.winner if not question.counted else None
        assert {"one": 1, "two": -1, None: 0}[winner] == found.signs[place]
        units = question.decided_at if question.decided else question.units
        assert units == found.units[place]


def test_of_equal_arms_every_winner_is_wrong_and_chance_within_cells_decides_about_these_cells() -> None:
    design = Design(15, 5, 1, 0.5, Resemblance(0.1, 0.3, 0.5))
    plan, like, these = (
        planned_power(small_study(**({"stopping": "decided", "about": about} if about else {})), design, (0.0, 0.3))
        for about in ("", "cells-like-these", "these-cells")
    )
    for found in (plan, like, these):
        assert np.isnan(found[0].power)
        assert found[1].wrong <= 0.01
    assert plan[0].wrong <= 0.05
    assert like[0].wrong <= 0.05
    assert these[0].wrong > 0.3


def test_more_arms_ask_more_questions_and_have_less_power_each() -> None:
    three = small_study(arms={name: {"model": f"lab:{name}"} for name in ("a1", "b1", "c1")})
    two = small_study()
    assert design_of_study(three, 15, 0.5).level == pytest.approx(0.05 / 3)
    assert of(planned_power(three, design_of_study(three, 15, 0.5), (0.3,))) < of(
        planned_power(two, design_of_study(two, 15, 0.5), (0.3,))
    )


def test_simulated_arms_have_the_difference_that_was_asked_for() -> None:
    design = Design(20, 4, 1, 0.5, Resemblance(0.1, 0.3, 0.5))
    arms = simulated_arms(np.random.default_rng(0), design, 0.2, samples=600)
    assert unit_differences(arms, by_start=False).shape == (600, 80)
    assert unit_differences(arms, by_start=True).shape == (600, 20)
    assert (arms[0] - arms[1]).mean() == pytest.approx(0.2, abs=0.02)


def test_a_margin_reduces_power_and_a_difference_at_the_margin_has_none() -> None:
    design = Design(20, 2, 1, 0.5, UNRELATED)
    without, beyond = (planned_power(small_study(margin=margin), design, (0.15, 0.6)) for margin in (0.0, 0.15))
    assert beyond[0].power <= 0.05
    assert beyond[0].power < without[0].power
    assert 0.5 < beyond[1].power <= without[1].power


def equal_on_average(random: np.random.Generator, studies: int, rate: float, repetitions: int) -> np.ndarray:
    """Return two arms of equal rates: the first always succeeds or fails at a position, the second varies."""
    first = np.repeat((random.random((studies, 15, 1, 1)) < rate), 5, axis=2)
    shape = (studies, 15, 5, repetitions)
    return np.asarray([np.broadcast_to(first, shape), random.random(shape) < rate], np.float64)


@pytest.mark.parametrize("repetitions", [1, 2, 5])
@pytest.mark.parametrize("rate", [0.3, 0.95])
def test_arms_that_differ_by_position_and_not_on_average_are_rarely_told_apart(rate: float, repetitions: int) -> None:
    arms = equal_on_average(np.random.default_rng(repetitions), 1500, rate, repetitions)
    means = arms.mean(-1)
    p = flip_p_values((means[0] - means[1]).sum(2))
    found = paired_intervals(means[0], means[1], repetitions, 0.95)
    plan = winner_signs(found.estimate, found.low, found.high, p, 0.05, 0.0)
    like = decided_studies(unit_differences(arms, by_start=True), 0.05, 0.0, by_start=True)
    assert np.mean(plan != 0) <= 0.05
    assert np.mean(like.signs != 0) <= 0.05
    if rate == 0.95 and repetitions == 5:
        assert np.mean(p <= 0.05) > 0.15, "the test alone is not enough"
    if repetitions == 5:
        each_block = unit_differences(arms, by_start=False)
        wealth = [capital(as_share(sign * each_block), 0.5, None)[:, -1] for sign in (1, -1)]
        assert np.mean(np.maximum(*wealth) >= 40) > 0.2, "repetitions are not independent draws"
