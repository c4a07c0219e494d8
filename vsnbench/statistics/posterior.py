"""A Bayesian answer beside the other, for whoever asks: what to believe of two rates after the trials.

Jeffreys' prior, Beta(1/2, 1/2), and the outcomes at their effective sample size, so that repetitions of a cell weigh as
little as in the intervals. The two rates are taken for independent: where the cells are shared and hard cells are hard
for both, the difference is surer than this says.
"""

from dataclasses import dataclass

import numpy as np

from vsnbench.statistics.clustered import EffectiveSample
from vsnbench.statistics.rates import CONFIDENCE, Interval

_POINTS = 4001


@dataclass(frozen=True, slots=True)
class Posterior:
    """What is believed of a success rate: a Beta distribution."""

    a: float
    b: float

    @property
    def mean(self) -> float:
        """Expected success rate."""
        return self.a / (self.a + self.b)

    def interval(self, confidence: float = CONFIDENCE) -> Interval:
        """Return the interval that holds the rate with this probability, the same left out at either end."""
        from scipy.stats import beta

        tail = (1 - confidence) / 2
        return Interval(float(beta.ppf(tail, self.a, self.b)), float(beta.ppf(1 - tail, self.a, self.b)))


def posterior(sample: EffectiveSample) -> Posterior:
    """Return what is believed after these outcomes."""
    successes = sample.rate * sample.trials
    return Posterior(0.5 + successes, 0.5 + sample.trials - successes)


def probability_better(first: Posterior, second: Posterior, by: float = 0.0) -> float:
    """Return the probability that the first rate is above the second by more than `by`, a share."""
    from scipy.stats import beta

    # Over the quantiles of one: exact in them, however steep the density.
    quantiles = beta.ppf((np.arange(_POINTS) + 0.5) / _POINTS, first.a, first.b)
    return float(np.mean(beta.cdf(quantiles - by, second.a, second.b)))
