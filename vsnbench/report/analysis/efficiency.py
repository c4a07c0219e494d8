"""Progress, SPL, SoftSPL and SCT of every episode of a DataFrame; `vsnbench.protocol.metrics` defines them."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from vsnbench.report.analysis.conditions import Condition
from vsnbench.results.reading.blinding import HIDDEN_COLUMNS

if TYPE_CHECKING:
    import pandas as pd


def spl_of(frame: "pd.DataFrame") -> "pd.Series[float]":
    """Return `vsnbench.protocol.metrics.spl` of every row; 0 for failures, whatever their lengths."""
    efficiency = _efficiency(frame)
    return efficiency.where(frame["success"], 0.0)


def progress_of(frame: "pd.DataFrame") -> "pd.Series[float]":
    """Return `vsnbench.protocol.metrics.progress` of every row; NaN if a length is unknown."""
    shortest, remaining = frame["shortest_m"], frame["remaining_m"]
    moved = (1.0 - remaining / shortest.where(shortest > 0)).clip(0.0, 1.0)
    there = (remaining <= 0).astype(float)  # the start was at the goal
    return moved.where(shortest > 0, there).where(remaining.notna() & shortest.notna())


def soft_spl_of(frame: "pd.DataFrame") -> "pd.Series[float]":
    """Return `vsnbench.protocol.metrics.soft_spl` of every row."""
    return progress_of(frame) * _efficiency(frame)


def _efficiency(frame: "pd.DataFrame") -> "pd.Series[float]":
    shortest, path = frame["shortest_m"], frame["path_m"]
    longest = shortest.where(shortest >= path, path)
    ratio = (shortest / longest.where(longest > 0)).where(longest > 0, 1.0)
    return ratio.where(shortest.notna() & path.notna())


def add_times(frame: "pd.DataFrame", conditions: Sequence[Condition]) -> "pd.DataFrame":
    """Add the column `sct`, and keep `thinking_s` where it counts: of real robots; blinded arms have no wall times."""
    speeds = {condition.number: condition.max_linear_m_s for condition in conditions}
    real = [condition for condition in conditions if not condition.simulated]
    frame["thinking_s"] = frame["thinking_s"].where(frame["condition"].isin([condition.number for condition in real]))
    # The time that a model thinks would reveal it in a blinded study.
    if blind := [condition.number for condition in conditions if condition.blind]:
        for name in HIDDEN_COLUMNS & set(frame.columns):
            frame[name] = frame[name].where(~frame["condition"].isin(blind))
    counted_s = frame["thinking_s"].where(frame["condition"].isin([condition.number for condition in real]), 0.0)
    frame["sct"] = sct_of(frame, frame["condition"].map(speeds).astype(np.float64), frame["duration_s"] + counted_s)
    return frame


def sct_of(
    frame: "pd.DataFrame", max_linear_m_s: "pd.Series[float]", taken_s: "pd.Series[float]"
) -> "pd.Series[float]":
    """Return `vsnbench.protocol.metrics.sct` of every row; 0 for failures, whatever is known of them."""
    ideal = frame["shortest_m"] / max_linear_m_s.where(max_linear_m_s > 0)
    longest = ideal.where(ideal >= taken_s, taken_s)
    ratio = (ideal / longest.where(longest > 0)).where(longest > 0, 1.0).where(ideal.notna() & taken_s.notna())
    return ratio.where(frame["success"], 0.0)
