"""Sensitivity analyses, failures, judgements and sim-to-real comparison as JSON values."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from vsnbench.report.analysis.courses import MEASURES, CourseSummary
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.failures import Failures
from vsnbench.report.analysis.fields import finite, interval_fields
from vsnbench.report.analysis.judgements import Judgements
from vsnbench.report.analysis.sensitivity import (
    Drift,
    Recount,
    by_distance,
    by_seed,
    drift,
    grid,
    sensitivity,
    spread_between,
)
from vsnbench.report.analysis.summary import ConditionSummary
from vsnbench.report.comparison.sim_vs_real import SimRealPair
from vsnbench.statistics.rates import UNKNOWN


def sensitivity_fields(record: ReportData, summary: ConditionSummary) -> dict[str, Any]:
    """Return the sensitivity analyses of a condition; lists are empty without data.

    Drift is only for real robots and rehearsals, because simulations do not drift.
    """
    seeds = by_seed(record, summary)
    operator_activity = not summary.condition.simulated or bool((record.of(summary.condition)["session"] > 0).any())
    cells = grid(summary)
    return {
        "recounts": _recounts(sensitivity(record, summary)),
        "by_shortest_path": _recounts(by_distance(record, summary)),
        "by_seed": _recounts(seeds),
        "standard_deviation_between_seeds": finite(spread_between(seeds)),
        "drift": _drift(drift(record, summary)) if operator_activity else None,
        "drift_over_all_sessions": _drift(drift(record, summary, whole=True)) if operator_activity else None,
        "cells": [
            {"goal": goal, "start": start, "successes": cell.successes, "episodes": cell.trials}
            for (goal, start), cell in cells.cells.items()
        ],
    }


def _drift(found: Drift | None) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        "p": finite(found.trend.p),
        "least_p": finite(found.trend.least_p),
        "exact": found.trend.exact,
        "success_later": finite(found.trend.later),
        "difference": finite(found.difference),
        **interval_fields(found.interval),
        "thirds": _recounts(found.thirds),
    }


def _recounts(groups: Sequence[Recount]) -> list[dict[str, Any]]:
    return [
        {
            "counted": recount.label,
            "successes": recount.proportion.successes,
            "episodes": recount.proportion.trials,
            "success_rate": finite(recount.proportion.rate),
            **interval_fields(recount.interval or UNKNOWN),
            "bound": recount.bound is not None,
        }
        for recount in groups
    ]


def failure_fields(failures: Failures | None) -> dict[str, Any] | None:
    """Return the failure causes of a condition; None without failures."""
    if failures is None:
        return None
    return {
        "failed": failures.failed,
        "examined": failures.examined,
        "kinds": {kind.value: number for kind, number in failures.kinds},
        "never_in_view": failures.never_in_view,
        "touched": dict(failures.touched),
        "places": [asdict(place) for place in failures.places],
    }


def course_fields(courses: CourseSummary | None) -> dict[str, Any] | None:
    """Return stages and courses of a condition; None without counted episodes."""
    if courses is None:
        return None
    return {
        "examined": courses.examined,
        "stages": {stage.value: number for stage, number in courses.stages},
        **{f"mean_{name}": finite(getattr(courses, name)) for name in MEASURES},
    }


def judgement_fields(judgements: Judgements | None) -> dict[str, Any] | None:
    """Return the operators' judgements; None without any."""
    if judgements is None:
        return None
    return {
        "judged": judgements.judged,
        "overrule_rate": finite(judgements.rate),
        "overruled": [asdict(change) for change in judgements.overruled],
    }


def sim_vs_real_fields(pair: SimRealPair) -> dict[str, Any]:
    """Return the comparison of real and simulated results; null if unknown."""
    like, ranks, gain = pair.agreement, pair.ranks, pair.powered
    return {
        "real": pair.real.name,
        "simulated": pair.simulated.name,
        "goals": list(pair.goals),
        "successes_real": pair.first.successes,
        "episodes_real": pair.first.episodes,
        "successes_simulated": pair.second.successes,
        "episodes_simulated": pair.second.episodes,
        "difference": finite(pair.difference),
        **interval_fields(pair.interval),
        "shared_cells": like.cells if like else 0,
        "agreement": {name: finite(getattr(like, name)) for name in ("bias", "error", "same", "kappa")}
        if like
        else None,
        "rank_correlation": {"rho": finite(ranks.rho), **interval_fields(ranks.interval)} if ranks else None,
        "prediction_powered": {
            "success_rate": finite(gain.rate),
            **interval_fields(gain.interval),
            "plain_success_rate": finite(gain.plain_rate),
            **interval_fields(gain.plain_interval, "plain_ci"),
            "tuning": gain.tuning,
            "cells": gain.cells,
            "cells_saved": gain.saved,
        }
        if gain
        else None,
    }
