"""What a reviewer asks as JSON values: recounts, drift, cells, why episodes failed, who overruled, the twin."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from vsnbench.report.failures import Failures
from vsnbench.report.judgements import Judgements
from vsnbench.report.record import Record
from vsnbench.report.scrutiny import Drift, Recount, by_distance, by_seed, drift, grid, sensitivity, spread_between
from vsnbench.report.summary import ConditionSummary
from vsnbench.report.twins import Twin
from vsnbench.statistics.rates import Interval


def scrutiny_fields(record: Record, one: ConditionSummary) -> dict[str, Any]:
    """Return everything that `vsnbench.report.scrutiny` counts of a condition; empty lists where nothing supports it.

    Drift is of real sessions and rehearsed ones alone: a simulator by itself does not tire.
    """
    seeds = by_seed(record, one)
    attended = not one.condition.simulated or bool((record.of(one.condition)["session"] > 0).any())
    cells = grid(one)
    return {
        "sensitivity": _recounts(sensitivity(record, one)),
        "by_shortest_path": _recounts(by_distance(record, one)),
        "by_seed": _recounts(seeds),
        "standard_deviation_between_seeds": _finite(spread_between(seeds)),
        "drift": _drift(drift(record, one)) if attended else None,
        "drift_over_all_sessions": _drift(drift(record, one, whole=True)) if attended else None,
        "cells": [
            {"goal": goal, "start": start, "successes": cell.successes, "episodes": cell.trials}
            for (goal, start), cell in cells.cells.items()
        ],
    }


def _drift(found: Drift | None) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        "p": _finite(found.trend.p),
        "least_p": _finite(found.trend.least_p),
        "exact": found.trend.exact,
        "success_later": _finite(found.trend.later),
        "difference": _finite(found.difference),
        **_ends("ci", found.interval),
        "thirds": _recounts(found.thirds),
    }


def _recounts(groups: Sequence[Recount]) -> list[dict[str, Any]]:
    return [
        {
            "counted": each.what,
            "successes": each.proportion.successes,
            "episodes": each.proportion.trials,
            "success_rate": _finite(each.proportion.rate),
            **_ends("ci", each.interval),
            "bound": each.bound is not None,
        }
        for each in groups
    ]


def failure_fields(failures: Failures | None) -> dict[str, Any] | None:
    """Return why the episodes of a condition failed; None where none did."""
    if failures is None:
        return None
    return {
        "failed": failures.failed,
        "looked_at": failures.examined,
        "kinds": {kind.value: number for kind, number in failures.looked_at},
        "never_in_view": failures.never_in_view,
        "touched": dict(failures.touched),
    }


def judgement_fields(judgements: Judgements | None) -> dict[str, Any] | None:
    """Return what people made of the protocol's verdicts; None where nobody judged."""
    if judgements is None:
        return None
    return {
        "judged": judgements.judged,
        "overrule_rate": _finite(judgements.rate),
        "overruled": [asdict(each) for each in judgements.overruled],
    }


def twin_fields(twin: Twin) -> dict[str, Any]:
    """Return one model for real and simulated; unknown is null."""
    like, ranks, gain = twin.agreement, twin.ranks, twin.powered
    return {
        "real": twin.real.name,
        "simulated": twin.simulated.name,
        "goals": list(twin.goals),
        "successes_real": twin.first.successes,
        "episodes_real": twin.first.episodes,
        "successes_simulated": twin.second.successes,
        "episodes_simulated": twin.second.episodes,
        "difference": _finite(twin.difference),
        **_ends("ci", twin.interval),
        "shared_cells": like.cells if like else 0,
        "agreement": {name: _finite(getattr(like, name)) for name in ("bias", "error", "same", "kappa")}
        if like
        else None,
        "rank_correlation": {"rho": _finite(ranks.rho), **_ends("ci", ranks.interval)} if ranks else None,
        "prediction_powered": {
            "success_rate": _finite(gain.rate),
            **_ends("ci", gain.interval),
            "plain_success_rate": _finite(gain.plain_rate),
            **_ends("plain_ci", gain.plain_interval),
            "tuning": gain.tuning,
            "cells": gain.cells,
            "cells_saved": gain.saved,
        }
        if gain
        else None,
    }


def _ends(name: str, interval: Interval | None) -> dict[str, float | None]:
    low, high = (interval.low, interval.high) if interval else (math.nan, math.nan)
    return {f"{name}_low": _finite(low), f"{name}_high": _finite(high)}


def _finite(number: float) -> float | None:
    return float(number) if math.isfinite(number) else None
