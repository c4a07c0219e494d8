"""Differences in actions, progress, paths, times and courses, with intervals clustered by starting position."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vsnbench.report.analysis import courses
from vsnbench.statistics.bootstrap import ClusterSums, clustered_bootstrap
from vsnbench.statistics.rates import Interval

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class EffectComparison:
    """Two means of a measure on the shared goals, and the interval of their difference."""

    measure: str
    first: float
    second: float
    interval: Interval
    """Interval of the difference; unknown with too few starting positions."""

    @property
    def counts_actions(self) -> bool:
        """Whether the measure is a number of actions."""
        return MEASURES[self.measure] == "actions"

    @property
    def difference(self) -> float:
        """First minus second."""
        return self.first - self.second


MEASURES = {
    "actions": "actions",
    "actions of successful episodes": "actions",
    "progress": "progress",
    "SPL": "spl",
    "SoftSPL": "soft_spl",
    "SCT": "sct",
    "driving time (s)": "duration_s",
    "thinking time (s)": "thinking_s",
    "minimum clearance (m)": "clearance_min_m",
    "clearance, 5th percentile (m)": "clearance_p5_m",
    "heading change (°/m)": "heading_change_deg_per_m",
    "waiting time (s)": "waiting_s",
}
"""Measure -> column of the episodes, or of `ReportData.courses`."""

MEASURED = tuple(column for column in dict.fromkeys(MEASURES.values()) if column not in courses.MEASURES)
"""Those that every record has."""
OPTIONAL = ("progress", "duration_s", "thinking_s", *courses.MEASURES)
"""Those that are left out where no episode of a model has them."""


def effects(
    first: "pd.DataFrame", second: "pd.DataFrame", goals: Sequence[str], *, together: bool
) -> tuple[EffectComparison, ...]:
    """Compare every measure on some goals; without those of which both models lack values.

    Args:
        first: counted episodes of the first condition.
        second: counted episodes of the second condition.
        goals: shared goals.
        together: both conditions use the same starting positions, which are resampled together.
    """
    sides = [rows[rows["goal"].isin(list(goals))] for rows in (first, second)]
    starts = sorted(set(sides[0]["start"]) | set(sides[1]["start"])) if together else None
    found = []
    for measure, column in MEASURES.items():
        if any(column not in rows for rows in sides):
            continue
        chosen = [rows[rows["success"]] if "successful" in measure else rows for rows in sides]
        a, b = (_by_start(rows, column, starts) for rows in chosen)
        interval = clustered_bootstrap(a, b, shared_clusters=together)
        if column in OPTIONAL and not (a.counts.any() and b.counts.any()):
            continue
        found.append(EffectComparison(measure, a.mean, b.mean, interval))
    return tuple(found)


def _by_start(rows: "pd.DataFrame", column: str, starts: Sequence[int] | None) -> ClusterSums:
    grouped = rows.groupby("start")[column].agg(["sum", "count"])
    if starts is not None:
        grouped = grouped.reindex(list(starts), fill_value=0)
    return ClusterSums(grouped["sum"].to_numpy(np.float64), grouped["count"].to_numpy(np.int64))
