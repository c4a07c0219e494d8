"""A comparison in plain sentences: who is better, how sure that is, and what was left out."""

from vsnbench.harmless_text import harmless
from vsnbench.report.compare import ALL, SHARED, Comparison, RateComparison
from vsnbench.report.outlook import advice
from vsnbench.report.peers import ENOUGH_COVERAGE
from vsnbench.statistics.rates import Interval


def verdicts(comparison: Comparison) -> tuple[str, ...]:
    """Return each set of goals in one plain sentence or two."""
    return tuple(_verdict(comparison, rate) for rate in comparison.rates)


def _verdict(comparison: Comparison, rate: RateComparison) -> str:
    a, b = harmless(comparison.first.name), harmless(comparison.second.name)
    where = f"On {rate.scope}" if rate.scope in (ALL, SHARED) else f"On {harmless(rate.scope)}"
    if not rate.first.episodes or not rate.second.episodes:
        empty = a if not rate.first.episodes else b
        return f"{where}: nothing to compare, no trial of {empty} is done."
    interval, (mine, theirs) = rate.interval, rate.compared
    numbers = (
        f"{mine.successes}/{mine.trials} against {theirs.successes}/{theirs.trials}{_sources(rate)}, "
        f"{100 * rate.difference:+.1f} points {interval_words(interval, 1)}"
    )
    caveat = _caveats(comparison, rate)
    if not rate.covered:
        short = [
            f"{each.episodes} of {each.planned} trials of {name}"
            for name, each in ((a, rate.first), (b, rate.second))
            if each.coverage < ENOUGH_COVERAGE
        ]
        return (
            f"{where}: {numbers}. No winner is named: only {' and '.join(short)} are done, "
            f"{ENOUGH_COVERAGE:.0%} are needed.{caveat}"
        )
    p = f"p {compared(rate.p)}"
    if rate.scope != ALL and comparison.asked > 1:
        p += f", p {compared(rate.adjusted_p)} after Holm's correction for {comparison.asked} questions"
    if rate.significant:
        better, worse = (a, b) if rate.difference > 0 else (b, a)
        return f"{where}: {better} succeeds more often than {worse}: {numbers}, {p}.{caveat}"
    if rate.below_level:
        p += "; the test alone would tell them apart, but the interval holds 0"
    further = advice(rate.outlook, rate.reach, comparison.level)
    further = f"; {further}" if further else ""
    if interval.known and 0.0 not in interval and rate.reach.too_few(comparison.level):
        caveat = f" Of so few starting positions an interval that leaves 0 out is no evidence by itself.{caveat}"
    return f"{where}: not distinguishable at this number of trials ({numbers}, {p}){further}.{caveat}"


def _sources(rate: RateComparison) -> str:
    """Say aloud where episodes repeat cells: `(75 episodes from 15 cells)`."""
    said = [
        f"{each.trials} episodes from {cells} cells"
        for each, cells in zip(rate.compared, rate.cells, strict=True)
        if each.trials > cells
    ]
    return f" ({' and '.join(dict.fromkeys(said))})" if said else ""


def _caveats(comparison: Comparison, rate: RateComparison) -> str:
    words = []
    if rate.scope == ALL:
        words.append("Their goals differ: the difference may be the goals' and not the models'.")
    if rate.pairing and any(rate.pairing.left_out):
        for one, left in zip((comparison.first, comparison.second), rate.pairing.left_out, strict=True):
            if left:
                words.append(f"Left out: {left} episodes of {harmless(one.name)} in cells that only it was tried in.")
    words += [
        f"{harmless(one.name)} is handed the site: an upper bound, not a competitor."
        for one in (comparison.first, comparison.second)
        if one.surveyed
    ]
    return "".join(f" {each}" for each in words)


def interval_words(interval: Interval, places: int = 0) -> str:
    """Return the interval of a difference in points; where there is none, why."""
    if not interval.known:
        return "(too few starting positions for an interval)"
    return f"[{100 * interval.low:+.{places}f}, {100 * interval.high:+.{places}f}]"


def compared(p: float) -> str:
    """Return a p-value with what compares it: `= 0.031`, `< 0.001`."""
    return f"= {p:.3f}" if p >= 0.001 else "< 0.001"
