"""Simulates the coverage of each interval and the false positives of each test.

    python benchmarks/statistics_coverage.py                     15 starting positions, 2,000 samples a line: minutes
    python benchmarks/statistics_coverage.py --samples 200       fewer samples, for a quick check
    python benchmarks/statistics_coverage.py --write             writes the tables into benchmarks/results/
    python benchmarks/statistics_coverage.py --only several      one of coverage, several, effects, powered
    python benchmarks/statistics_coverage.py --workers 16        lines on several processes
    python benchmarks/statistics_coverage.py --twin DIR          prediction-powered, on a record: one model with and
                                                                 without noise, the noisy campaigns playing "real"

It prints tables with shares in percent. The success probabilities of the starting positions are 0 or 1, Beta(1/2, 1/2)
or Beta(2, 2) with the mean at the rate, or all the same; each of two models has its own probabilities. For comparison,
the tables include the methods that treat all episodes as independent. The table `effects` has logit-normal
probabilities: 40 % of the variance is common to a starting position and both models, 30 % to a position and a model,
and 30 % belongs to a cell and a model. The seeds of a cell are correlated through latent normal variables.
"""

import argparse
import itertools
import math
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from scipy.optimize import brentq
from scipy.special import expit, ndtri
from scipy.stats import binom

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.statistics.test_paired import mcnemar_exact
from vsnbench.statistics.balanced import flip_p_values, paired_intervals, rate_intervals
from vsnbench.statistics.clustered import Cell, Outcomes, independent_difference, rate_interval
from vsnbench.statistics.paired import PairedCell, PairedOutcomes, paired_interval, paired_test
from vsnbench.statistics.permutation import exchange_clusters
from vsnbench.statistics.prediction_powered import OnlyPredicted, PredictedCell, powered
from vsnbench.statistics.rates import Proportion, newcombe, wilson

STARTS = 15
SEEDS = (1, 2, 5)
RATES = (0.1, 0.3, 0.5, 0.8)
RESULT = Path(__file__).resolve().parent / "results" / "2026-11-23-statistics-coverage.md"
Floats = np.ndarray

CHANCES: dict[str, Callable[[np.random.Generator, float], Floats]] = {
    "0 or 1": lambda random, rate: (random.random(STARTS) < rate).astype(float),
    "Beta(½,½)": lambda random, rate: random.beta(rate, 1 - rate, STARTS),
    "Beta(2,2)": lambda random, rate: random.beta(4 * rate, 4 * (1 - rate), STARTS),
    "the same": lambda _random, rate: np.full(STARTS, rate),
}


def outcomes(wins: Floats, seeds: int) -> Outcomes:
    """Return the outcomes of one model, with one cell per starting position."""
    return Outcomes(tuple(Cell(start, int(won), seeds) for start, won in enumerate(wins)))


def paired(first: Outcomes, second: Outcomes) -> PairedOutcomes:
    """Return the outcomes of two models in the same cells."""
    return PairedOutcomes(tuple(PairedCell(a, b) for a, b in zip(first.cells, second.cells, strict=True)))


def line(kind: str, rate: float, seeds: int, samples: int) -> list[float]:
    """Return the percentages of one setting: coverage of rates and differences, and false positives."""
    random = np.random.default_rng([seeds, int(100 * rate), list(CHANCES).index(kind)])
    other = rate + 0.25 if rate <= 0.5 else rate - 0.25
    counts = np.zeros(9)
    for _ in range(samples):
        chances = [CHANCES[kind](random, mean) for mean in (rate, rate, other)]
        draws = [random.binomial(1, chance[:, None], (STARTS, seeds)) for chance in chances]
        a, b, c = (outcomes(drawn.sum(1), seeds) for drawn in draws)
        apart = paired(a, c)
        discordant = [int(((draws[i] == 1) & (draws[j] == 0)).sum()) for i, j in ((0, 1), (1, 0))]
        counts += (
            rate in wilson(a.proportion),
            rate in rate_interval(a),
            rate - other in newcombe(a.proportion, c.proportion),
            rate - other in paired_interval(apart),
            rate - other in independent_difference(a, c),
            0.0 in paired_interval(paired(a, b)),
            mcnemar_exact(*discordant) < 0.05,
            paired_test(paired(a, b)) < 0.05,
            exchange_clusters(a, b, draws=999) < 0.05,
        )
    return (100 * counts / samples).tolist()


HEADINGS = (
    *("Wilson", "**by position**", "Newcombe", "**paired**", "**independent**", "**paired, no difference**"),
    *("McNemar", "**signs flipped**", "**exchanged**"),
)


Job = Callable[[], str]
"""Returns one line of a table."""


def coverage_line(seeds: int, kind: str, rate: float, samples: int) -> str:
    """Return a line of the table with one cell per position."""
    shares = " | ".join(f"{share:.1f}" for share in line(kind, rate, seeds, samples))
    return f"| {seeds} | {kind} | {rate} | {shares} |"


def coverage_table(samples: int) -> tuple[list[str], list[Job]]:
    """Return the table's header and the jobs for its lines."""
    head = [
        "| seeds | chances | rate | " + " | ".join(HEADINGS) + " |",
        "| ---: | --- | ---: |" + " ---: |" * len(HEADINGS),
    ]
    settings = itertools.product(SEEDS, CHANCES, RATES)
    return head, [partial(coverage_line, seeds, kind, rate, samples) for seeds, kind, rate in settings]


def several_line(starts: int, goals: int, alike: float, samples: int) -> str:
    """Return a line of the table of several goals from few positions, with the percentages at each rate."""
    spread, shares = 1 / alike - 1, []
    for rate in RATES:
        random = np.random.default_rng([starts, goals, int(100 * alike), int(100 * rate)])
        other = rate + 0.25 if rate <= 0.5 else rate - 0.25
        counts = np.zeros(3)
        for _ in range(samples):
            a, b, c = (
                Outcomes(tuple(Cell(s, int(won), 1) for s, row in enumerate(wins) for won in row))
                for each in (rate, rate, other)
                for wins in [
                    random.random((starts, goals)) < random.beta(spread * each, spread * (1 - each), starts)[:, None]
                ]
            )
            counts += (
                rate in rate_interval(a),
                rate - other in paired_interval(paired(a, c)),
                paired_test(paired(a, b)) < 0.05,
            )
        shares.append(100 * counts / samples)
    columns = " | ".join(" ".join(f"{each[which]:.1f}" for each in shares) for which in range(3))
    return f"| {starts} | {goals} | {alike} | {columns} |"


def several_table(samples: int) -> tuple[list[str], list[Job]]:
    """Return the table's header and the jobs for its lines."""
    head = [
        "| positions | goals | resemblance | **rate** | **paired** | **signs flipped** |",
        "| ---: | ---: | ---: | --- | --- | --- |",
    ]
    settings = itertools.product(((5, 2), (5, 5), (8, 5), (15, 5)), (0.02, 0.1, 0.2, 0.5))
    return head, [partial(several_line, starts, goals, alike, samples) for (starts, goals), alike in settings]


def logit_for(rate: float, spread: float) -> float:
    """Return the mean logit that gives this mean success rate."""
    points, weights = np.polynomial.hermite_e.hermegauss(101)
    weights = weights / weights.sum()
    return float(brentq(lambda mean: float(weights @ expit(mean + spread * points)) - rate, -90, 90))


def with_effects(
    random: np.random.Generator, shape: tuple[int, int, int, int], spread: float, alike: float, rates: Iterable[float]
) -> Iterator[Floats]:
    """Yield, for each rate, (samples, starts, goals) success rates of the cells of a model.

    Args:
        random: source of randomness.
        shape: samples, starting positions, goals, seeds.
        spread: standard deviation of the logits.
        alike: correlation of the latent normal variables of the seeds of a cell.
        rates: mean success rate of each model.
    """
    samples, starts, goals, _ = shape
    shared = math.sqrt(0.4) * random.standard_normal((samples, starts, 1))
    for rate in rates:
        own = math.sqrt(0.3) * random.standard_normal((samples, starts, 1))
        cell = math.sqrt(0.3) * random.standard_normal((samples, starts, goals))
        limit = ndtri(expit(logit_for(rate, spread) + spread * (shared + own + cell)))
        behind = math.sqrt(alike) * random.standard_normal((samples, starts, goals, 1))
        behind = behind + math.sqrt(1 - alike) * random.standard_normal(shape)
        yield (behind < limit[..., None]).mean(-1)


def wilson_coverage(trials: int, rate: float) -> float:
    """Return the exact coverage of Wilson's interval for a number of independent trials."""
    chances = binom.pmf(np.arange(trials + 1), trials, rate)
    return float(sum(p for k, p in enumerate(chances) if rate in wilson(Proportion(k, trials))))


def effects_line(design: tuple[int, int, int], spread: float, alike: float, samples: int) -> str:
    """Return a line of the table of position effects, with the percentages at each rate."""
    starts, goals, seeds = design
    columns = []
    for rate in RATES:
        random = np.random.default_rng([*design, round(10 * spread), round(10 * alike), round(100 * rate)])
        other = rate + 0.25 if rate <= 0.5 else rate - 0.25
        a, b, c = with_effects(random, (samples, *design), spread, alike, (rate, rate, other))
        single, apart = rate_intervals(a, seeds, 0.95), paired_intervals(a, c, seeds, 0.95)
        true = rate - other
        columns.append(
            (
                100 * np.mean((single.low <= rate) & (rate <= single.high)),
                100 * np.mean((apart.low <= true) & (true <= apart.high)),
                100 * np.mean(single.high - single.low),
                100 * np.mean(flip_p_values((a - b).sum(2)) <= 0.05) if starts <= STARTS else math.nan,
            )
        )
    shown = " | ".join(
        " ".join("–" if math.isnan(each[which]) else f"{each[which]:.{places}f}" for each in columns)
        for which, places in ((0, 1), (1, 1), (2, 0), (3, 1))
    )
    exact = " ".join(f"{100 * wilson_coverage(starts, rate):.1f}" for rate in RATES)
    return f"| {starts} | {goals} | {seeds} | {spread:g} | {alike:g} | {exact} | {shown} |"


def effects_table(samples: int) -> tuple[list[str], list[Job]]:
    """Return the table's header and the jobs for its lines."""
    head = [
        "| positions | goals | seeds | logit SD | seeds alike | Wilson | **rate** | **paired** | width | **flipped** |",
        "| ---: | ---: | ---: | ---: | ---: | --- | --- | --- | --- | --- |",
    ]
    designs = ((15, 6, 5), (15, 5, 5), (15, 5, 2), (15, 8, 2), (15, 5, 1), (8, 6, 5), (20, 6, 5), (30, 6, 5))
    settings = itertools.product(designs, (1.0, 2.5, 4.0), (0.0, 0.5, 1.0))
    return head, [
        partial(effects_line, design, spread, alike, samples)
        for design, spread, alike in settings
        if design[2] > 1 or not alike
    ]


def powered_line(positions: int, rate: float, alike: float, trust: float, samples: int) -> str:
    """Return a line of the table of prediction-powered estimates.

    Of 75 cells, 25 random ones are driven on the real robot; or, if `positions` is not 0, all cells of that number of
    starting positions.
    """
    random = np.random.default_rng([positions, int(100 * rate), int(alike), int(100 * trust)])
    starts = np.repeat(np.arange(STARTS), 5)
    held = plain = 0
    widths = np.zeros(3)
    for _ in range(samples):
        real = random.random(75) < random.beta(alike * rate, alike * (1 - rate), STARTS)[starts]
        twin = np.where(random.random(75) < trust, real, random.random(75) < 0.5)
        driven = np.isin(np.arange(75), random.permutation(75)[:25])
        if positions:
            driven = np.isin(starts, random.permutation(STARTS)[:positions])
        found = powered(
            [PredictedCell(Cell(int(starts[n]), int(real[n]), 1), float(twin[n])) for n in np.flatnonzero(driven)],
            [OnlyPredicted(int(starts[n]), float(twin[n])) for n in np.flatnonzero(~driven)],
        )
        if found is None:
            raise SystemExit("25 cells of 5 positions are enough")
        held += rate in found.interval
        plain += rate in found.plain_interval
        widths += (
            found.interval.high - found.interval.low,
            found.plain_interval.high - found.plain_interval.low,
            found.saved,
        )
    width, plain_width, saved = widths / samples
    where = f"all of {positions} positions" if positions else "25 anywhere"
    return (
        f"| {where} | {rate} | {1 / (1 + alike):.2f} | {trust} | {100 * plain / samples:.1f} "
        f"| {100 * held / samples:.1f} | {100 * plain_width:.0f} | {100 * width:.0f} | {saved:.0f} |"
    )


def powered_table(samples: int) -> tuple[list[str], list[Job]]:
    """Return the table's header and the jobs for its lines."""
    head = [
        "| driven | rate | resemblance | twin right | plain | **powered** | width | **width** | cells saved |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    settings = itertools.product((0, 5), RATES, (4.0, 50.0), (0.0, 0.6, 0.95))
    return head, [partial(powered_line, *each, samples) for each in settings]


def twin(directory: Path, model: str, samples: int) -> None:
    """Use some positions of the noisy campaigns as real trials and the noiseless campaign as the twin's."""
    from vsnbench.report.analysis.conditions import Selection
    from vsnbench.report.build import read
    from vsnbench.results.files.directory import ResultsDirectory

    record = read(ResultsDirectory.locate(directory, None).database_url, Selection(models=(model,)))
    noisy, clean = (next(item for item in record.conditions if item.noisy is noise) for noise in (True, False))
    rates = {
        condition.number: record.counted(condition).astype({"goal": str}).groupby(["goal", "start"])["success"].mean()
        for condition in (noisy, clean)
    }
    cells = [cell for cell in rates[clean.number].index if cell in rates[noisy.number].index]
    truth = float(np.mean([rates[noisy.number][cell] for cell in cells]))
    campaigns = dict(list(record.counted(noisy).astype({"goal": str}).groupby("campaign")))
    real = {number: rows.set_index(["goal", "start"])["success"] for number, rows in campaigns.items()}
    random = np.random.default_rng(0)
    print(f"{len(cells)} cells, real rate {truth:.3f}, twin's {np.mean([rates[clean.number][c] for c in cells]):.3f}")
    for driven in (5, 8, 10):
        held = plain = 0
        sums = np.zeros(3)
        for _ in range(samples):
            chosen = set(random.permutation(sorted({start for _, start in cells}))[:driven].tolist())
            outcome = real[int(random.choice(list(real)))]
            found = powered(
                [
                    PredictedCell(Cell(int(c[1]), int(outcome[c]), 1), float(rates[clean.number][c]))
                    for c in cells
                    if c[1] in chosen
                ],
                [OnlyPredicted(int(c[1]), float(rates[clean.number][c])) for c in cells if c[1] not in chosen],
            )
            if found is None:
                raise SystemExit("too few cells to predict from")
            held += truth in found.interval
            plain += truth in found.plain_interval
            sums += (
                found.interval.high - found.interval.low,
                found.plain_interval.high - found.plain_interval.low,
                found.saved,
            )
        width, plain_width, saved = sums / samples
        print(
            f"{driven} of 15 positions: plain covers {100 * plain / samples:.1f} % at {100 * plain_width:.0f} points, "
            f"powered {100 * held / samples:.1f} % at {100 * width:.0f}; {saved:.1f} cells saved"
        )


def write(name: str, lines: list[str]) -> None:
    """Write a table between its markers in the results page."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    page = RESULT.read_text(encoding="utf-8")
    before, after = page.split(begin)[0], page.split(end)[1]
    RESULT.write_text(before + begin + "\n".join(lines) + "\n" + end + after, encoding="utf-8")


def main() -> None:
    """Simulate the settings and print the tables; write them with --write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=2000)
    parser.add_argument("--write", action="store_true", help="write the tables into benchmarks/results/")
    parser.add_argument("--only", choices=("coverage", "several", "effects", "powered"))
    parser.add_argument("--workers", type=int, default=1, help="number of processes")
    parser.add_argument("--model", default="pirlnav", help="model to read with --twin")
    parser.add_argument("--twin", type=Path, metavar="DIR", help="results directory for the prediction-powered check")
    options = parser.parse_args()
    if options.twin:
        twin(options.twin, options.model, options.samples)
        return
    tables = {"coverage": coverage_table, "several": several_table, "effects": effects_table, "powered": powered_table}
    with ProcessPoolExecutor(options.workers) as pool:
        for name, make in tables.items():
            if options.only not in (None, name):
                continue
            lines, jobs = make(options.samples)
            print(f"\n{name}", *lines, sep="\n")
            for made in pool.map(_call, jobs):
                lines.append(made)
                print(made, flush=True)
            if options.write:
                write(name, lines)


def _call(job: Job) -> str:
    return job()


if __name__ == "__main__":
    main()
