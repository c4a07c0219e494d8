"""Simulates what studies claim of equal models, and whether `study report` and `compare` agree.

    python benchmarks/study_claims.py                   2,000 studies a line: minutes on one core
    python benchmarks/study_claims.py --studies 200     fewer studies, for a quick check
    python benchmarks/study_claims.py --write           writes the tables into benchmarks/results/

Table `these cells`: studies with `stopping: decided` and `about: these-cells` of two arms with the same success
probability in every cell, so that the outcomes differ by chance alone. "Names an arm" is the share that says which arm
succeeded more often in the plan's trials, and "wrong" the share in which all trials of the plan, also those that were
not run, say otherwise. Table `several arms`: complete plans of equal arms; the share that names any winner, and the
share in which every interval covers its difference. Table `records`: models with various success rates, written to a
record, in which every combination of three and of four is compared by `study report` and by `compare`.
"""

import itertools
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from study_errors import ALPHA, STARTS, chances

from benchmarks.support.simulated_tables import print_tables
from tests.report.records import Attempt, Lab
from tests.report.study.test_primary import standing
from tests.study.studies import small_study
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.summary import summarise
from vsnbench.report.build import read
from vsnbench.report.comparison.compare import RateComparison, compare
from vsnbench.report.study.primary import analyse
from vsnbench.statistics.balanced import flip_p_values, paired_intervals
from vsnbench.statistics.conclusion import DifferenceEvidence, conclude, winner_signs
from vsnbench.statistics.multiple import holm, simultaneous
from vsnbench.statistics.paired import paired_interval
from vsnbench.study.power import decided_studies, unit_differences

RESULT = Path(__file__).resolve().parent / "results" / "2026-11-24-study-claims.md"
RATES, STRENGTHS, REPETITIONS = (0.1, 0.3, 0.5, 0.8), (0.0, 1.0, 2.5), (1, 2, 5)
GOAL_NAMES = ("chair", "bed")


def these_line(studies: int, rate: float, strength: float) -> str:
    """Return a line of the table `these cells`, with the percentages at 1, 2 and 5 repetitions."""
    named, wrong = [], []
    for repetitions in REPETITIONS:
        random = np.random.default_rng([round(100 * rate), round(10 * strength), repetitions])
        chance = chances(random, studies, rate, strength, STARTS)[..., None]
        arms = np.asarray([random.random((*chance.shape[:3], repetitions)) < chance for _ in range(2)], np.float64)
        blocks = random.permuted(unit_differences(arms, by_start=False), axis=1)
        signs = decided_studies(blocks, ALPHA, 0.0, by_start=False).signs
        named.append(100 * np.mean(signs != 0))
        wrong.append(100 * np.mean((signs != 0) & (signs != np.sign(blocks.sum(1)))))
    shown = " | ".join(" ".join(f"{share:.1f}" for share in shares) for shares in (named, wrong))
    return f"| {rate} | {strength:g} | {shown} |"


def several_line(studies: int, arms: int, rate: float, strength: float, shared: bool) -> str:
    """Return a line of the table `several arms`; with `shared`, all arms have the same probability in a cell."""
    random = np.random.default_rng([arms, round(100 * rate), round(10 * strength), int(shared)])
    common = chances(random, studies, rate, strength, STARTS)
    own = [common if shared else chances(random, studies, rate, strength, STARTS) for _ in range(arms)]
    means = [(random.random(chance.shape) < chance).astype(np.float64) for chance in own]
    pairs = list(itertools.combinations(range(arms), 2))
    p = np.array([flip_p_values((means[a] - means[b]).sum(2)) for a, b in pairs])
    adjusted = np.array([holm(column) for column in p.T]).T
    shares = []
    for confidence in (simultaneous(len(pairs), ALPHA), 1 - ALPHA):
        found = [paired_intervals(means[a], means[b], 1, confidence) for a, b in pairs]
        signs = [
            winner_signs(each.estimate, each.low, each.high, adjusted[n], ALPHA, 0.0) for n, each in enumerate(found)
        ]
        covered = np.all([(each.low <= 0) & (each.high >= 0) for each in found], axis=0)
        shares += [100 * np.mean(np.any(signs, axis=0)), 100 * np.mean(covered)]
    kind = "the same in a cell" if shared else "own by position"
    return f"| {arms} | {kind} | {rate} | {strength:g} | " + " | ".join(f"{share:.1f}" for share in shares) + " |"


def records_line(models: int, seed: int) -> str:
    """Write a record, and return a line of the table `records`."""
    random, starts = np.random.default_rng(seed), range(1, STARTS + 1)
    rates = random.uniform(0.2, 0.75, models)
    with tempfile.TemporaryDirectory() as directory:
        lab = Lab(Path(directory))
        won = {
            f"m{n}": {(goal, start) for goal in GOAL_NAMES for start in starts if random.random() < rate}
            for n, rate in enumerate(rates)
        }
        for name, successes in won.items():
            attempts = [
                Attempt(goal, start, success=(goal, start) in successes) for goal in GOAL_NAMES for start in starts
            ]
            lab.write(attempts, model=name)
        record = read(lab.url, Selection())
        summaries = summarise(record)
        pairs = winners = differing = single = 0
        for size in (3, 4):
            for names in itertools.combinations(won, size):
                study = small_study(arms={name: {"model": f"lab:{name}"} for name in names}, goals=list(GOAL_NAMES))
                trials = standing(study, STARTS, lambda arm, goal, start: (goal, start) in won[arm])
                compared = compare(record, summaries, names, with_power=False)
                for answer, comparison in zip(analyse(study, trials).answers, compared, strict=True):
                    rate = comparison.rates[0]
                    interval = rate.interval
                    same = (interval.low, interval.high) == (answer.low, answer.high)
                    pairs += 1
                    winners += answer.conclusion.names_winner
                    differing += rate.conclusion is not answer.conclusion or not same
                    single += _with_own_interval(rate) is not answer.conclusion
    return f"| {models} | {pairs} | {winners} | {differing} | {single} |"


def _with_own_interval(rate: RateComparison) -> object:
    """Return the conclusion with an interval of this pair alone, as `compare` used it before."""
    if rate.pairing is None:
        raise SystemExit("the models share their cells")
    evidence = DifferenceEvidence(rate.difference, paired_interval(rate.pairing.outcomes), rate.adjusted_p, ALPHA)
    return conclude(evidence)


Job = Callable[[], str]


def tables(studies: int) -> dict[str, tuple[list[str], list[Job]]]:
    """Return the header of each table and the jobs for its lines."""
    several = itertools.product((3, 4, 6), (0.3, 0.6, 0.9), (1.0, 2.5), (True, False))
    return {
        "these cells": (
            ["| rate | logit SD | names an arm | wrong |", "| ---: | ---: | --- | --- |"],
            [partial(these_line, studies, rate, strength) for strength in STRENGTHS for rate in RATES],
        ),
        "several arms": (
            [
                (
                    "| arms | chances | rate | logit SD | **winner** | **all cover** | winner, single "
                    "| all cover, single |"
                ),
                "| ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: |",
            ],
            [partial(several_line, studies, *each) for each in several],
        ),
        "records": (
            ["| models | pairs | winners | **differ** | differ, single |", "| ---: | ---: | ---: | ---: | ---: |"],
            [partial(records_line, 7, seed) for seed in range(4)],
        ),
    }


if __name__ == "__main__":
    print_tables(__doc__, tables, RESULT, unit="studies", count=2000)
