"""Fields that CSV and JSON share: raw numbers, rates from 0 to 1, None if unknown."""

import math
from typing import Any

from vsnbench.report.analysis.conditions import Condition
from vsnbench.statistics.rates import Interval


def finite(number: float) -> float | None:
    """Return a number for JSON: None for NaN and infinities."""
    return float(number) if math.isfinite(number) else None


def interval_fields(interval: Interval, name: str = "ci") -> dict[str, float | None]:
    """Return the ends of an interval as `NAME_low` and `NAME_high`; None if unknown."""
    return {f"{name}_low": finite(interval.low), f"{name}_high": finite(interval.high)}


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
