"""Fields that CSV and JSON share: raw numbers, rates from 0 to 1, None if unknown."""

import math
from typing import Any

from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.summary import Summary
from vsnbench.statistics.rates import Interval


def finite(number: float) -> float | None:
    """Return a number for JSON: None for NaN and infinities."""
    return float(number) if math.isfinite(number) else None


def interval_fields(interval: Interval, name: str = "ci") -> dict[str, float | None]:
    """Return the ends of an interval as `NAME_low` and `NAME_high`; None if unknown."""
    return {f"{name}_low": finite(interval.low), f"{name}_high": finite(interval.high)}


def summary_fields(summary: Summary) -> dict[str, Any]:
    """Return a summary with stable field names; None if unknown."""
    fields = {
        "successes": summary.successes,
        "episodes": summary.episodes,
        "planned": summary.planned,
        "coverage": summary.coverage,
        "void": summary.void,
        "unjudged": summary.unjudged,
        "success_rate": summary.success_rate,
        **interval_fields(summary.interval),
        "mean_actions": summary.mean_actions,
        "mean_actions_successful": summary.mean_actions_successful,
        "spl": summary.spl,
        "soft_spl": summary.soft_spl,
        "spl_episodes": summary.spl_episodes,
        "soft_spl_episodes": summary.soft_spl_episodes,
        "progress": summary.progress,
        "progress_episodes": summary.progress_episodes,
        "sct": summary.sct,
        "sct_episodes": summary.sct_episodes,
        "mean_driving_s": summary.mean_driving_s,
        "mean_thinking_s": summary.mean_thinking_s,
        "median_distance_to_goal_m": summary.median_distance_m,
        "collisions": summary.collisions,
        "step_limits": summary.step_limits,
        "time_limits": summary.time_limits,
        "path_limits": summary.path_limits,
        "trivial": summary.trivial,
        "cells": len(summary.outcomes.cells),
    }
    return {name: finite(value) if isinstance(value, float) else value for name, value in fields.items()}


def condition_fields(condition: Condition) -> dict[str, Any]:
    """Return a condition with stable field names."""
    return {
        "name": condition.name,
        "model": condition.model,
        "weights_label": condition.weights_label,
        "weights_sha256": condition.weights_sha256,
        "surveyed": condition.surveyed,
        "robot": condition.robot,
        "kind": condition.kind,
        "environment": condition.environment,
        "published": condition.published,
        "site": condition.site,
        "site_sha256": condition.site_sha256,
        "protocol_name": condition.protocol_name,
        "max_actions": condition.max_actions,
        "max_time_s": condition.max_time_s,
        "max_path_m": condition.max_path_m,
        "success_distance_m": condition.success_distance_m,
        "noise": condition.noisy,
    }
