"""Sentences that state the conclusion of a comparison, its numbers and its caveats."""

from vsnbench.report.analysis.comparability import MIN_COVERAGE
from vsnbench.report.comparison.compare import ALL, SHARED, Comparison, RateComparison
from vsnbench.report.comparison.power import advice
from vsnbench.report.wording import caution, compared, interval_words
from vsnbench.statistics.conclusion import Conclusion
from vsnbench.text.sanitize import sanitize


def verdicts(comparison: Comparison) -> tuple[str, ...]:
    """Return the conclusion for each set of goals."""
    return tuple(_verdict(comparison, rate) for rate in comparison.rates)


def _verdict(comparison: Comparison, rate: RateComparison) -> str:
    a, b = sanitize(comparison.first.name), sanitize(comparison.second.name)
    where = f"On {rate.scope}" if rate.scope in (ALL, SHARED) else f"On {sanitize(rate.scope)}"
    if not rate.first.episodes or not rate.second.episodes:
        empty = a if not rate.first.episodes else b
        return f"{where}: no comparison, because no trial of {empty} is complete."
    interval, (mine, theirs) = rate.interval, rate.compared
    numbers = (
        f"{mine.successes}/{mine.trials} against {theirs.successes}/{theirs.trials}{_sources(rate)}, "
        f"{100 * rate.difference:+.1f} points {interval_words(interval, 1)}"
    )
    caveat = _caveats(comparison, rate)
    if not rate.covered:
        short = [
            f"{compared.episodes} of {compared.planned} trials of {name}"
            for name, compared in ((a, rate.first), (b, rate.second))
            if compared.coverage < MIN_COVERAGE
        ]
        return (
            f"{where}: {numbers}. No winner is named: only {' and '.join(short)} are complete, "
            f"and {MIN_COVERAGE:.0%} are required.{caveat}"
        )
    p = f"p {compared(rate.p)}"
    if rate.scope != ALL and comparison.asked > 1:
        p += f", p {compared(rate.adjusted_p)} after Holm's correction for {comparison.asked} comparisons"
    conclusion = rate.conclusion
    if conclusion.names_winner:
        better, worse = (a, b) if conclusion.sign > 0 else (b, a)
        return f"{where}: {better} succeeds more often than {worse}: {numbers}, {p}.{caveat}"
    if conclusion is Conclusion.TEST_ONLY:
        p += f"; {caution(conclusion)}"
    further = advice(rate.power, rate.attainable, comparison.level)
    further = f"; {further}" if further else ""
    if conclusion is Conclusion.INTERVAL_ONLY and rate.attainable.too_few(comparison.level):
        caveat = f" With so few starting positions an interval that excludes 0 is not evidence by itself.{caveat}"
    return f"{where}: no difference shown at this number of trials ({numbers}, {p}){further}.{caveat}"


def _sources(rate: RateComparison) -> str:
    """Return the number of cells if episodes repeat cells: `(75 episodes from 15 cells)`."""
    counts = [
        f"{compared.trials} episodes from {cells} cells"
        for compared, cells in zip(rate.compared, rate.cells, strict=True)
        if compared.trials > cells
    ]
    return f" ({' and '.join(dict.fromkeys(counts))})" if counts else ""


def _caveats(comparison: Comparison, rate: RateComparison) -> str:
    caveats = []
    if rate.scope == ALL:
        caveats.append("The goals differ, so the difference may come from the goals rather than the models.")
    if rate.pairing and any(rate.pairing.left_out):
        for condition, left in zip((comparison.first, comparison.second), rate.pairing.left_out, strict=True):
            if left:
                caveats.append(
                    f"Left out: {left} episodes of {sanitize(condition.name)} in cells without episodes of the other."
                )
    caveats += [
        f"{sanitize(condition.name)} is a person: a reference, not a competitor."
        if condition.driver
        else f"{sanitize(condition.name)} has access to the site file: an upper bound, not a competitor."
        for condition in (comparison.first, comparison.second)
        if condition.not_competing
    ]
    return "".join(f" {caveat}" for caveat in caveats)
