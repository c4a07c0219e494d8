"""Error rates of studies that are looked at after every block, by simulation: false decisions, power, mean blocks.

Two nulls, and both are true ones. *These cells*: a plan whose paired differences have mean 0 comes in random order, and
the sequence without replacement speaks of it. *Cells like these*: every block's differences are drawn anew from two
equal rates, and the sequence with replacement speaks of them. The fixed McNemar test looks once, at the end. Takes
under two minutes on two cores: `python benchmarks/study_errors.py [studies]`.
"""

import sys
import time

import numpy as np
import numpy.typing as npt
from scipy.stats import binom

from vsnbench.statistics.betting import as_share, capital

Floats = npt.NDArray[np.float64]
ALPHA = 0.05
RATE = 0.6


def drawn(random: np.random.Generator, studies: int, cells: int, first: float, second: float) -> Floats:
    """Return (studies, cells) paired differences of independent outcomes."""
    shape = studies, cells
    return (random.random(shape) < first).astype(float) - (random.random(shape) < second)


def even_plans(random: np.random.Generator, studies: int, cells: int) -> Floats:
    """Return plans of mean 0, each in a random order: as many blocks for the one as for the other."""
    apart = random.binomial(cells, 2 * RATE * (1 - RATE), studies) // 2
    place = np.arange(cells)
    values = np.where(place < apart[:, None], 1.0, np.where(place < 2 * apart[:, None], -1.0, 0.0))
    return random.permuted(values, axis=1)


def decided(differences: Floats, size: int | None) -> tuple[Floats, Floats]:
    """Return, for each study, whether it is decided by a bet (not by counting out), and after how many blocks."""
    shares = as_share(differences)
    cells = shares.shape[1]
    best = np.maximum(capital(shares, 0.5, size), capital(1 - shares, 0.5, size))
    over = best >= 2 / ALPHA
    first = np.where(over.any(1), over.argmax(1), cells - 1)
    bet = over.any(1) & np.isfinite(best[np.arange(len(best)), first])
    return bet.astype(float), first + 1.0


def mcnemar(differences: Floats) -> Floats:
    """Return whether McNemar's exact test of the whole plan finds a difference."""
    wins, losses = (differences > 0).sum(1), (differences < 0).sum(1)
    p = np.minimum(1, 2 * binom.cdf(np.minimum(wins, losses), wins + losses, 0.5))
    return np.asarray((p <= ALPHA).astype(float))


def three_arms(random: np.random.Generator, studies: int, cells: int) -> str:
    """Return the family-wise error of three equal arms: these cells without, cells like these with replacement."""
    fixed = np.broadcast_to(np.arange(cells) < round(RATE * cells), (studies, cells))
    plans = [random.permuted(fixed, axis=1).astype(float) for _ in range(3)]
    fresh = [(random.random((studies, cells)) < RATE).astype(float) for _ in range(3)]
    told = []
    for arms, size in ((plans, cells), (fresh, None)):
        wrong = np.zeros(studies, bool)
        for first, second in ((0, 1), (0, 2), (1, 2)):
            shares = as_share(arms[first] - arms[second])
            best = np.maximum(capital(shares, 0.5, size)[:, -1], capital(1 - shares, 0.5, size)[:, -1])
            wrong |= best >= 2 * 3 / ALPHA  # Holm's first step; without it there is no second
        told.append(f"{wrong.mean():.3f}")
    return f"{told[0]} of these cells, {told[1]} of cells like these"


def main(studies: int) -> None:
    random = np.random.default_rng(0)
    began = time.perf_counter()
    print(f"{studies} studies a line, rate {RATE:.0%}, alpha {ALPHA}, looked at after every block\n")
    print("| cells | truth | without repl.: decided | blocks | with repl.: decided | blocks | McNemar, at the end |")
    print("| ---: | --- | ---: | ---: | ---: | ---: | ---: |")
    for cells in (75, 150):
        lines = {
            "no difference in these cells": even_plans(random, studies, cells),
            "no difference in cells like these": drawn(random, studies, cells, RATE, RATE),
            "+15 points": drawn(random, studies, cells, RATE + 0.15, RATE),
            "+30 points": drawn(random, studies, cells, RATE + 0.30, RATE),
        }
        for truth, differences in lines.items():
            (a, a_blocks), (b, b_blocks) = decided(differences, cells), decided(differences, None)
            print(
                f"| {cells} | {truth} | {a.mean():.3f} | {a_blocks.mean():.1f} | {b.mean():.3f} | "
                f"{b_blocks.mean():.1f} | {mcnemar(differences).mean():.3f} |"
            )
        print(f"three arms, {cells} cells, any of the pairs falsely told apart: {three_arms(random, studies, cells)}")
    print(f"\n{time.perf_counter() - began:.0f} s")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000)
