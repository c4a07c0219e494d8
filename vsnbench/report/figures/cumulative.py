"""Cumulative plots: outcomes over the number of actions, and distance over driving time."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsnbench.palette import COLORS
from vsnbench.protocol.execution import STACK
from vsnbench.report.analysis.comparability import kinds_note
from vsnbench.report.analysis.conditions import Condition, footnotes
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.summary import ConditionSummary, ReportResults
from vsnbench.report.figures.style import (
    DASHES,
    MAX_CONDITIONS,
    Drawing,
    column_in,
    in_pages,
    light_grid,
    new_figure,
    page_in,
    styled,
)
from vsnbench.report.figures.text_layout import legend_below, shown
from vsnbench.report.wording import listed
from vsnbench.results.schema.engine import to_json
from vsnbench.text.sanitize import sanitize
from vsnbench.values.robot_identity import IMPORTED

_MOST_POINTS = 2000
"""Maximum number of points of a curve."""


def outcomes_over_actions(record: ReportData, results: ReportResults) -> Iterator[Drawing]:
    """Draw the cumulative incidence of success and failure over the number of actions.

    Success and failure are competing events: a survival curve would rate a model that collides early like one that
    succeeds early. A figure shows conditions of one robot, site and protocol, and so of one action limit, on the goals
    that they share; imports have figures of their own. Nothing is drawn without counted episodes, and of stacks, which
    have no actions.
    """
    groups: dict[tuple[object, ...], list[ConditionSummary]] = {}
    for summary in results.conditions:
        if summary.total.episodes and summary.condition.execution != STACK:
            groups.setdefault((*_alike(summary.condition), _goals(summary)), []).append(summary)
    pages = [
        group[at : at + MAX_CONDITIONS] for group in groups.values() for at in range(0, len(group), MAX_CONDITIONS)
    ]
    return in_pages(pages, 1, lambda page: _outcomes(record, page[0], _goals(page[0][0])))


def _alike(condition: Condition) -> tuple[object, ...]:
    """Return what conditions in one figure have in common."""
    protocol = to_json(dict(condition.protocol), in_order=True)
    return condition.robot, condition.simulated, condition.kind == IMPORTED, condition.site_sha256, protocol


def _goals(summary: ConditionSummary) -> tuple[str, ...]:
    """Return the goals shared with comparable conditions that a condition was tested on; all of its own without any."""
    own = [str(group.goal) for group in summary.goals if group.episodes]
    return tuple(goal for goal in own if goal in summary.shared_goals) or tuple(own)


def _outcomes(record: ReportData, drawn: Sequence[ConditionSummary], goals: Sequence[str]) -> Drawing:
    counted = {}
    for summary in drawn:
        rows = record.counted(summary.condition)
        counted[summary.condition.number] = rows[rows["goal"].isin(list(goals))]
    with styled():
        figure = new_figure(column_in() if len(drawn) <= 3 else page_in() * 0.75, 2.0)
        panels = figure.subplots(1, 2, sharex=True, sharey=True)
        longest = max(int(rows["actions"].max()) for rows in counted.values())
        cap = max(longest, drawn[0].condition.max_actions or 0)
        lines, labels = [], []
        for index, summary in enumerate(drawn):
            rows = counted[summary.condition.number]
            actions, success = rows["actions"].to_numpy(), rows["success"].to_numpy()
            style: dict[str, Any] = {"color": COLORS[index], "linestyle": DASHES[index], "linewidth": 1.1}
            for axes, which in zip(panels, (success, ~success), strict=True):
                lengths, share = _incidence(actions, which, cap)
                (line,) = axes.step([0, *lengths], [0, *(100 * share)], where="post", **style)
            lines.append(line)
            labels.append(f"{summary.condition.name} (n = {len(rows)})")
        for axes, title in zip(panels, ("succeeded", "failed"), strict=True):
            axes.set_title(title, loc="left")
            axes.set_xlim(0, cap * 1.02)
            axes.set_ylim(0, 102)
            axes.set_xlabel("actions")
            light_grid(axes, "both")
        panels[0].set_ylabel("episodes (%)")
        legend_below(figure, lines, labels)
    words = "; ".join(
        f"{shown(summary.condition.name)}: {rows['success'].sum()} of {len(rows)} succeeded, "
        f"mean {rows['actions'].mean():.0f} actions"
        for summary in drawn
        for rows in [counted[summary.condition.number]]
    )
    first = drawn[0].condition
    end = f"the limit of {first.max_actions} actions" if first.max_actions else "the longest episode"
    caption = (
        f"{sanitize(first.robot_title or first.robot)}, {first.environment}, in {sanitize(first.site)}, on "
        f"{listed(sanitize(goal) for goal in goals)}: share of the episodes that had succeeded (left) and failed "
        f"(right) by number of actions. The curves end at {end}, at the success rate and the failure rate. Failures: "
        "STOP too far away, collision, or a limit."
    )
    if note := kinds_note(summary.condition for summary in drawn):
        caption += f" {note}"
    return Drawing(
        "outcomes-over-actions",
        "Success and failure over actions",
        f"Shares of episodes that succeeded and failed by action count. {words}.",
        caption,
        footnotes([summary.condition for summary in drawn]),
        figure,
    )


def _incidence(
    actions: NDArray[np.int64], which: NDArray[np.bool_], end: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return action counts, ascending, and the share of all episodes with this outcome by then."""
    lengths, ended = np.unique(actions[which], return_counts=True)
    share = np.cumsum(ended) / len(actions)
    return np.append(lengths, end), np.append(share, share[-1] if len(share) else 0.0)


def mileage(record: ReportData) -> Drawing | None:
    """Draw each robot's distance over its driving time; None without distance.

    All attempts are included, also void ones.
    """
    robots: dict[tuple[str, bool], list[int]] = {}
    for condition in record.conditions:
        robots.setdefault((condition.robot_title or condition.robot, condition.simulated), []).append(condition.number)
    curves = []
    for (title, simulated), numbers in robots.items():
        rows = record.episodes[record.episodes["condition"].isin(numbers)]
        rows = rows[rows["path_m"].notna() & rows["duration_s"].notna()].sort_values("started_at")
        if rows["path_m"].sum() > 0:
            hours = np.cumsum(rows["duration_s"].to_numpy()) / 3600
            kilometres = np.cumsum(rows["path_m"].to_numpy()) / 1000
            keep = np.unique(np.linspace(0, len(hours) - 1, _MOST_POINTS).astype(int))
            curves.append((f"{title}, {'simulated' if simulated else 'real'}", hours[keep], kilometres[keep]))
    if not curves:
        return None
    with styled():
        figure = new_figure(column_in(), 2.0)
        axes = figure.subplots()
        lines, labels = [], []
        for index, (title, hours, kilometres) in enumerate(curves[:MAX_CONDITIONS]):
            (line,) = axes.plot(
                [0, *hours],
                [0, *kilometres],
                color=COLORS[index],
                linestyle=DASHES[index],
                linewidth=1.1,
            )
            lines.append(line)
            labels.append(f"{title}: {kilometres[-1]:.2f} km in {hours[-1]:.2f} h")
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.set_xlabel("driving time (h)")
        axes.set_ylabel("distance driven (km)")
        light_grid(axes, "both")
        legend_below(figure, lines, labels)
    words = "; ".join(f"{shown(title)} {km[-1]:.2f} km in {h[-1]:.2f} h" for title, h, km in curves)
    caption = "Distance over driving time on the robot's clock, over all attempts, including void ones."
    return Drawing("mileage", "Mileage", f"Distance over driving time. {words}.", caption, (), figure)
