from itertools import product

import numpy as np
import pytest
from scipy.stats import binom
from statsmodels.stats.power import TTestPower

from tests.study.studies import small_study
from vsnbench.statistics.power import Design, Resemblance
from vsnbench.study.power import PlannedPower, design_of_study, planned_power, simulated_blocks
from vsnbench.study.schedule import draw_schedule
from vsnbench.study.stopping import decide

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


def test_the_power_of_a_decided_study_is_that_of_its_own_schedule_and_stopping_rule() -> None:
    study = small_study(stopping="decided", about="these-cells", starting_positions="1-12", goals=["bed", "chair"])
    design = Design(12, 2, 1, 0.6, UNRELATED)
    told = of(planned_power(study, design, (0.5,)))
    random = np.random.default_rng(2)
    schedule = draw_schedule(study, tuple(range(1, 13)))
    won = 0
    for _ in range(150):
        succeeds = {
            (arm, goal, start): random.random() < rate
            for (arm, rate), goal, start in product((("one", 0.85), ("two", 0.35)), study.goals, range(1, 13))
        }
        blocks: dict[int, dict[str, bool]] = {}
        for one in schedule.trials:
            blocks.setdefault(one.block, {})[one.arm] = succeeds[one.arm, one.goal, one.start]
        question = decide(study, list(blocks.values())).questions[0]
        won += question.winner == "one" and not question.counted
    assert won / 150 == pytest.approx(told, abs=0.12)


def test_more_arms_ask_more_questions_and_have_less_power_each() -> None:
    three = small_study(arms={name: {"model": f"lab:{name}"} for name in ("a1", "b1", "c1")})
    two = small_study()
    assert design_of_study(three, 15, 0.5).level == pytest.approx(0.05 / 3)
    assert of(planned_power(three, design_of_study(three, 15, 0.5), (0.3,))) < of(
        planned_power(two, design_of_study(two, 15, 0.5), (0.3,))
    )


def test_simulated_blocks_have_the_difference_that_was_asked_for() -> None:
    blocks = simulated_blocks(np.random.default_rng(0), Design(20, 4, 1, 0.5, Resemblance(0.1, 0.3, 0.5)), 0.2)
    assert blocks.shape == (600, 80)
    assert blocks.mean() == pytest.approx(0.2, abs=0.02)


def test_a_margin_that_must_be_beaten_costs_power_and_none_is_left_at_the_margin_itself() -> None:
    design = Design(20, 2, 1, 0.5, UNRELATED)
    without, beyond = (planned_power(small_study(margin=margin), design, (0.15, 0.6)) for margin in (0.0, 0.15))
    assert beyond[0].power <= 0.05
    assert beyond[0].power < without[0].power
    assert 0.5 < beyond[1].power <= without[1].power
