"""The cluster bootstrap against scipy's bootstrap, and its coverage with few clusters."""

import numpy as np
import pytest
from scipy.stats import bootstrap

from vsnbench.statistics.bootstrap import ClusterSums, clustered_bootstrap
from vsnbench.statistics.rates import UNKNOWN


@pytest.mark.parametrize("clusters", [8, 15])
def test_the_bootstrap_covers_the_difference_of_clustered_means(clusters: int) -> None:
    random = np.random.default_rng(7)
    episodes, held, samples = 5, 0, 300
    counts = np.full(clusters, episodes)
    for sample in range(samples):
        place = random.normal(50, 15, clusters)  # hard positions are hard for both
        first = ClusterSums((place[:, None] + 5 + random.normal(0, 10, (clusters, episodes))).sum(1), counts)
        second = ClusterSums((place[:, None] + random.normal(0, 10, (clusters, episodes))).sum(1), counts)
        interval = clustered_bootstrap(first, second, shared_clusters=True, resamples=1000, seed=sample)
        held += 5 in interval
    assert 0.91 < held / samples < 0.99


def test_of_many_clusters_it_is_scipys_percentile_interval() -> None:
    random = np.random.default_rng(2)
    values = random.exponential(20, (2, 400))
    ones = np.ones(400, np.int64)
    mine = clustered_bootstrap(ClusterSums(values[0], ones), ClusterSums(values[1], ones), shared_clusters=True)
    theirs = bootstrap(
        (values[0] - values[1],), np.mean, method="percentile", n_resamples=9999, rng=random
    ).confidence_interval
    assert (mine.low, mine.high) == pytest.approx((theirs.low, theirs.high), abs=0.15)


def test_the_bootstrap_repeats_itself_and_knows_when_it_knows_nothing() -> None:
    few = ClusterSums(np.arange(7.0), np.full(7, 2))
    some = ClusterSums(np.array([10.0, 30.0, 20.0, 10.0, 40.0, 5.0, 0.0, 1.0]), np.full(8, 2))
    assert clustered_bootstrap(few, some, shared_clusters=False) is UNKNOWN
    first = clustered_bootstrap(some, some, shared_clusters=False, seed=3)
    assert first == clustered_bootstrap(some, some, shared_clusters=False, seed=3)
    assert 0.0 in first
    with pytest.raises(ValueError, match="same length"):
        clustered_bootstrap(few, some, shared_clusters=True)


@pytest.mark.parametrize("value", [0.0, 1.0, 150.0])
def test_values_that_do_not_vary_give_no_interval(value: float) -> None:
    constant = ClusterSums(np.full(15, 5 * value), np.full(15, 5))
    varied = ClusterSums(np.arange(15.0), np.full(15, 5))
    assert clustered_bootstrap(constant, constant, shared_clusters=True) is UNKNOWN
    assert clustered_bootstrap(constant, constant, shared_clusters=False) is UNKNOWN
    assert clustered_bootstrap(constant, varied, shared_clusters=True).known
