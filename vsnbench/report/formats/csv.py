"""The results of a report as CSV."""

import csv
import io
from collections.abc import Iterator
from typing import Any

from vsnbench.report.analysis.summary import ReportResults
from vsnbench.report.tables.conditions import CONDITION
from vsnbench.report.tables.success import SUMMARY
from vsnbench.text.sanitize import sanitize


def to_csv(results: ReportResults) -> str:
    """Return one row per goal and total; the column `goal` is `total` or `total of shared goals` for totals.

    `name` is unique per condition; `differing` lists the settings that differ from other conditions of the model.
    """
    file = io.StringIO()
    writer: csv.DictWriter[str] | None = None
    for line in _lines(results):
        if writer is None:
            writer = csv.DictWriter(file, list(line), lineterminator="\n")
            writer.writeheader()
        writer.writerow({name: _guarded(value) for name, value in line.items()})
    return file.getvalue()


def _lines(results: ReportResults) -> Iterator[dict[str, Any]]:
    for summary in results.conditions:
        condition = {
            **CONDITION.fields(summary.condition),
            "campaigns": " ".join(map(str, summary.condition.campaigns)),
            "seeds": " ".join(map(str, summary.condition.seeds)),
            "differing": ", ".join(summary.condition.differing),
            "shared_goals": " ".join(summary.shared_goals),
        }
        for group in summary.goals:
            yield {**condition, "goal": group.goal, **SUMMARY.fields(group)}
        yield {**condition, "goal": "total", **SUMMARY.fields(summary.total)}
        if summary.shared:
            yield {**condition, "goal": "total of shared goals", **SUMMARY.fields(summary.shared)}


def _guarded(value: object) -> object:
    """Sanitize a text for printing and for spreadsheets, which execute formulas."""
    if not isinstance(value, str):
        return value
    text = sanitize(value)
    return f"'{text}" if text[:1] in ("=", "+", "-", "@") else text
