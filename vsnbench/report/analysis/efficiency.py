"""Progress, SPL, SoftSPL and SCT of every episode, by column; `vsnbench.protocol.metrics` defines them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vsnbench.protocol.execution import STOP_AND_GO
from vsnbench.report.analysis.conditions import Condition
from vsnbench.results.reading.blinding import HIDDEN_COLUMNS

Floats = NDArray[np.float64]
Columns = Mapping[str, Any]
"""Columns of `episodes_frame.COLUMNS` by name, with one entry per episode."""


def spl_of(episodes: Columns) -> Floats:
    """Return `vsnbench.protocol.metrics.spl` of every episode; 0 for failures, whatever their lengths."""
    return np.where(episodes["success"], _efficiency(episodes), 0.0)


def progress_of(episodes: Columns) -> Floats:
    """Return `vsnbench.protocol.metrics.progress` of every episode; NaN if a length is unknown."""
    shortest, remaining = np.asarray(episodes["shortest_m"]), np.asarray(episodes["remaining_m"])
    moved = np.clip(1.0 - _ratio(remaining, shortest), 0.0, 1.0)
    there = np.where(remaining <= 0, 1.0, 0.0)  # the start was at the goal
    return np.where(np.isnan(shortest) | np.isnan(remaining), np.nan, np.where(shortest > 0, moved, there))


def soft_spl_of(episodes: Columns) -> Floats:
    """Return `vsnbench.protocol.metrics.soft_spl` of every episode."""
    return progress_of(episodes) * _efficiency(episodes)


def _efficiency(episodes: Columns) -> Floats:
    return _share(np.asarray(episodes["shortest_m"]), np.asarray(episodes["path_m"]))


def _share(ideal: Floats, taken: Floats) -> Floats:
    """Return the ideal divided by the larger of both; 1 for no way at all, NaN if one is unknown."""
    longest = np.where(ideal >= taken, ideal, taken)
    share = np.where(longest > 0, _ratio(ideal, longest), 1.0)
    return np.where(np.isnan(ideal) | np.isnan(taken), np.nan, share)


def _ratio(part: Floats, whole: Floats) -> Floats:
    with np.errstate(over="ignore"):  # of other writers' lengths
        return np.asarray(part / np.where(whole > 0, whole, np.nan))


def add_times(columns: dict[str, Any], conditions: Sequence[Condition]) -> None:
    """Add the column `sct`, and keep `thinking_s` where it counts: of real robots that rest while the model thinks.

    Blinded arms have no wall times, and in continuous execution no durations.
    """
    numbers = columns["condition"]
    adds_thinking = np.isin(
        numbers,
        [
            condition.number
            for condition in conditions
            if not condition.simulated and condition.execution == STOP_AND_GO
        ],
    )
    columns["thinking_s"] = np.where(adds_thinking, columns["thinking_s"], np.nan)
    # The time that a model thinks would reveal it in a blinded study.
    blind = [condition for condition in conditions if condition.blind]
    is_blind = np.isin(numbers, [condition.number for condition in blind])
    for name in HIDDEN_COLUMNS & columns.keys() if blind else ():
        columns[name] = np.where(is_blind, None if columns[name].dtype == object else np.nan, columns[name])
    if drives_on := [condition.number for condition in blind if condition.execution != STOP_AND_GO]:
        columns["duration_s"] = np.where(np.isin(numbers, drives_on), np.nan, columns["duration_s"])
    counted_s = np.where(adds_thinking, columns["thinking_s"], 0.0)
    speeds = np.full(max((condition.number for condition in conditions), default=0) + 1, np.nan)
    for condition in conditions:
        speeds[condition.number] = np.nan if condition.max_linear_m_s is None else condition.max_linear_m_s
    columns["sct"] = sct_of(columns, speeds[numbers], columns["duration_s"] + counted_s)


def sct_of(episodes: Columns, max_linear_m_s: ArrayLike, taken_s: ArrayLike) -> Floats:
    """Return `vsnbench.protocol.metrics.sct` of every episode; 0 for failures, whatever is known of them."""
    ideal_s = _ratio(np.asarray(episodes["shortest_m"]), np.asarray(max_linear_m_s))
    return np.where(episodes["success"], _share(ideal_s, np.asarray(taken_s)), 0.0)
