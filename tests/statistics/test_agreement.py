"""Agreement and ranks against statsmodels, scipy and hand-computed cases."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kendalltau, rankdata
from statsmodels.stats.inter_rater import cohens_kappa

from vsnbench.statistics.agreement import JudgedTwice, agreement, judge_agreement, rank_correlation
from vsnbench.statistics.clustered import Cell
from vsnbench.statistics.paired import PairedCell, PairedOutcomes


def singles(pairs: "list[tuple[bool, bool]]") -> PairedOutcomes:
    return PairedOutcomes(
        tuple(PairedCell(Cell(start, int(a), 1), Cell(start, int(b), 1)) for start, (a, b) in enumerate(pairs))
    )


@settings(deadline=None)
@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=2, max_size=40))
def test_of_single_episodes_it_is_cohens_kappa(pairs: "list[tuple[bool, bool]]") -> None:
    table = np.zeros((2, 2))
    for a, b in pairs:
        table[int(a), int(b)] += 1
    found = agreement(singles(pairs))
    assert found.same == pytest.approx(np.trace(table) / len(pairs))
    assert found.error == pytest.approx(math.sqrt(1 - found.same))
    if 0 < table.sum(0)[1] < len(pairs) and 0 < table.sum(1)[1] < len(pairs):
        assert found.kappa == pytest.approx(cohens_kappa(table).kappa)


def test_a_twin_that_flatters_is_said_to() -> None:
    cells = [(1, 4), (0, 2), (4, 4), (2, 2)]
    outcomes = PairedOutcomes(
        tuple(PairedCell(Cell(s, real, 4), Cell(s, simulated, 4)) for s, (real, simulated) in enumerate(cells))
    )
    found = agreement(outcomes)
    assert found.bias == pytest.approx((0.75 + 0.5) / 4)
    assert found.error == pytest.approx(math.sqrt((0.75**2 + 0.5**2) / 4))
    assert math.isnan(agreement(PairedOutcomes(())).bias)


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=4, max_size=30))
def test_rank_correlation_is_that_of_the_ranks(pairs: "list[tuple[int, int]]") -> None:
    first, second = ([float(each[side]) for each in pairs] for side in (0, 1))
    found = rank_correlation(first, second, range(len(first)))
    if len(set(first)) < 2 or len(set(second)) < 2:
        assert math.isnan(found.rho)
        return
    assert found.rho == pytest.approx(np.corrcoef(rankdata(first), rankdata(second))[0, 1])
    if found.interval.known:
        assert found.interval.low <= found.rho <= found.interval.high


def test_the_interval_of_a_rank_correlation_covers_whole_starting_positions() -> None:
    random, held, samples, starts = np.random.default_rng(3), 0, 300, np.repeat(range(15), 5)
    true = 6 / math.pi * math.asin(0.8 / 2)  # Spearman's rho of a normal pair with correlation 0.8
    for _ in range(samples):
        shared = np.sqrt(0.8) * random.standard_normal(15)[starts]
        x, y = (
            shared + np.sqrt(0.15) * random.standard_normal(15)[starts] + np.sqrt(0.05) * random.standard_normal(75)
            for _ in range(2)
        )
        held += true in rank_correlation(x.tolist(), y.tolist(), starts.tolist()).interval
    assert held / samples > 0.92


def test_the_interval_of_a_rank_correlation_covers_single_items() -> None:
    random, held, samples = np.random.default_rng(3), 0, 400
    true = 6 / math.pi * math.asin(0.6 / 2)  # Spearman's rho of a normal pair with correlation 0.6
    for _ in range(samples):
        x = random.standard_normal(30)
        y = 0.6 * x + 0.8 * random.standard_normal(30)
        found = rank_correlation(x.tolist(), y.tolist(), range(30))
        held += true in found.interval
        assert kendalltau(x, y).statistic * found.rho >= -0.1
    assert held / samples > 0.92
    assert math.isnan(rank_correlation([1, 2], [1, 2], [1, 2]).rho)
    assert not rank_correlation(range(14), [*range(13), 0], [n // 2 for n in range(14)]).interval.known, "7 positions"


JUDGED = st.lists(
    st.tuples(
        st.integers(0, 12), st.sampled_from(["success", "failure", "void"]), st.sampled_from(["success", "failure"])
    ),
    min_size=1,
    max_size=60,
)


@settings(deadline=None, max_examples=50)
@given(JUDGED)
def test_kappa_of_two_judges_is_that_of_statsmodels(items: "list[tuple[int, str, str]]") -> None:
    names = ["success", "failure", "void"]
    table = np.zeros((3, 3))
    for _, first, second in items:
        table[names.index(first), names.index(second)] += 1
    found = judge_agreement([JudgedTwice(*item) for item in items])
    assert (found.items, found.same) == (len(items), pytest.approx(np.trace(table) / len(items)))
    used = {name for _, *pair in items for name in pair}
    if len(used) == 1:
        assert math.isnan(found.kappa)
    else:
        assert found.kappa == pytest.approx(cohens_kappa(table).kappa, abs=1e-12)


def test_the_interval_of_kappa_is_that_of_resampled_starting_positions() -> None:
    random = np.random.default_rng(5)
    items = [(start, bool(random.random() < 0.5)) for start in range(15) for _ in range(3)]
    judged = [JudgedTwice(start, first, first ^ bool(random.random() < 0.15)) for start, first in items]
    found = judge_agreement(judged)
    kappas = []
    for _ in range(3000):  # written out: resample starting positions, and recompute kappa
        drawn = random.integers(0, 15, 15)
        pairs = [(item.first, item.second) for start in drawn for item in judged if item.cluster == start]
        first, second = np.array(pairs).T
        chance = first.mean() * second.mean() + (1 - first.mean()) * (1 - second.mean())
        kappas.append(((first == second).mean() - chance) / (1 - chance))
    plain = np.quantile(kappas, [0.025, 0.975])
    assert found.interval.low <= plain[0] + 0.02
    assert found.interval.high >= plain[1] - 0.02
    assert found.interval.high - found.interval.low < 1.4 * (plain[1] - plain[0])


def test_kappa_has_no_interval_with_few_starting_positions_or_complete_agreement() -> None:
    few = [JudgedTwice(start, start % 2, (start + 1) % 3 % 2) for start in range(7)]
    assert not judge_agreement(few).interval.known
    perfect = judge_agreement([JudgedTwice(start, start % 2, start % 2) for start in range(20)])
    assert (perfect.kappa, perfect.interval.known) == (1.0, False)
    assert math.isnan(judge_agreement([]).kappa)
