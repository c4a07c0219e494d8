"""Results as CSV, and the fields that JSON has in common with it: raw numbers, rates as shares of 0 to 1."""

import csv
import io
import math
from collections.abc import Iterator
from typing import Any

from vsnbench.harmless_text import harmless
from vsnbench.report.conditions import Condition
from vsnbench.report.summary import Results, Summary


def to_csv(results: Results) -> str:
    """Return one line a goal and one for each total; the column `goal` says `total` or `total of shared goals`.

    `name` is unique to a condition; `differing` holds every setting in which it differs from others of its model.
    """
    file = io.StringIO()
    writer: csv.DictWriter[str] | None = None
    for line in _lines(results):
        if writer is None:
            writer = csv.DictWriter(file, list(line), lineterminator="\n")
            writer.writeheader()
        writer.writerow({name: _guarded(value) for name, value in line.items()})
    return file.getvalue()


def summary_fields(summary: Summary) -> dict[str, Any]:
    """Return a summary under the names that scripts rely on; None for what is unknown."""
    interval = summary.interval
    fields = {
        "successes": summary.successes,
        "episodes": summary.episodes,
        "planned": summary.planned,
        "coverage": summary.coverage,
        "void": summary.void,
        "unjudged": summary.unjudged,
        "success_rate": summary.success_rate,
        "ci_low": interval.low,
        "ci_high": interval.high,
        "mean_actions": summary.mean_actions,
        "mean_actions_successful": summary.mean_actions_successful,
        "spl": summary.spl,
        "soft_spl": summary.soft_spl,
        "spl_episodes": summary.spl_episodes,
        "soft_spl_episodes": summary.soft_spl_episodes,
        "median_distance_to_goal_m": summary.median_distance_m,
        "collisions": summary.collisions,
        "step_limits": summary.step_limits,
        "trivial": summary.trivial,
        "cells": len(summary.outcomes.cells),
    }
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value for name, value in fields.items()
    }


def condition_fields(condition: Condition) -> dict[str, Any]:
    """Return what was tested, under the names that scripts rely on."""
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
        "max_actions": condition.max_actions,
        "success_distance_m": condition.success_distance_m,
        "noise": condition.noisy,
    }


def _lines(results: Results) -> Iterator[dict[str, Any]]:
    for one in results.conditions:
        condition = {
            **condition_fields(one.condition),
            "campaigns": " ".join(map(str, one.condition.campaigns)),
            "seeds": " ".join(map(str, one.condition.seeds)),
            "differing": ", ".join(one.condition.differing),
            "shared_goals": " ".join(one.shared_goals),
        }
        for goal in one.goals:
            yield {**condition, "goal": goal.goal, **summary_fields(goal.summary)}
        yield {**condition, "goal": "total", **summary_fields(one.total)}
        if one.shared:
            yield {**condition, "goal": "total of shared goals", **summary_fields(one.shared)}


def _guarded(value: object) -> object:
    """Make a text safe to print and to open: a spreadsheet runs one that begins like a formula."""
    if not isinstance(value, str):
        return value
    text = harmless(value)
    return f"'{text}" if text[:1] in ("=", "+", "-", "@") else text
