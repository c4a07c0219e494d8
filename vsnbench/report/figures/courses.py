"""Courses: how many episodes had succeeded or failed after so many actions, and how far each robot has driven."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from vsnbench.report.conditions import footnotes
from vsnbench.report.figures.lettering import legend_below, shown
from vsnbench.report.figures.style import (
    COLORS,
    COLUMN_IN,
    DASHES,
    MOST_CONDITIONS,
    PAGE_IN,
    Drawing,
    in_pages,
    light_grid,
    new_figure,
    page_name,
    styled,
)
from vsnbench.report.record import Record
from vsnbench.report.summary import ConditionSummary, Results

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_MOST_POINTS = 2000
"""More points than that on a curve are no more seen."""


def outcomes_over_actions(record: Record, results: Results) -> Iterator[Drawing]:
    """Draw how many episodes had succeeded, and how many had failed, after each number of actions.

    The two compete for every episode (cumulative incidence): one curve of episodes still going would call a model that
    crashes early as good as one that arrives early. Nothing is drawn when no episode counts.
    """
    done = [one for one in results.conditions if one.total.episodes]
    pages = in_pages(done, MOST_CONDITIONS)
    for number, drawn in enumerate(pages, start=1):
        yield _outcomes(record, drawn, number, len(pages))


def _outcomes(record: Record, drawn: Sequence[ConditionSummary], number: int, pages: int) -> Drawing:

    with styled():
        figure = new_figure(COLUMN_IN if len(drawn) <= 3 else PAGE_IN * 0.75, 2.0)
        panels = figure.subplots(1, 2, sharex=True, sharey=True)
        longest = max(int(record.counted(one.condition)["actions"].max()) for one in drawn)
        lines, labels = [], []
        for index, one in enumerate(drawn):
            rows = record.counted(one.condition)
            actions, success = rows["actions"].to_numpy(), rows["success"].to_numpy()
            look: dict[str, Any] = {"color": COLORS[index], "linestyle": DASHES[index], "linewidth": 1.1}
            for axes, which in zip(panels, (success, ~success), strict=True):
                lengths, share = _incidence(actions, which, longest)
                (line,) = axes.step([0, *lengths], [0, *(100 * share)], where="post", **look)
            lines.append(line)
            labels.append(f"{one.condition.name} (n = {len(rows)})")
        for axes, title in zip(panels, ("succeeded", "failed"), strict=True):
            axes.set_title(title, loc="left")
            axes.set_xlim(0, longest * 1.02)
            axes.set_ylim(0, 102)
            axes.set_xlabel("actions")
            light_grid(axes, "both")
        panels[0].set_ylabel("episodes (%)")
        legend_below(figure, lines, labels)
    words = "; ".join(
        f"{shown(one.condition.name)}: {one.total.successes} of {one.total.episodes} succeeded, "
        f"mean {one.total.mean_actions:.0f} actions"
        for one in drawn
    )
    caption = (
        "Share of the episodes that had succeeded (left) and failed (right) after so many actions; the curves of a "
        "model end at its success rate and at the rest of 100 %. Failed: STOP too far away, a collision, or the cap."
    )
    return Drawing(
        page_name("outcomes-over-actions", number),
        f"When episodes succeed, and when they fail{f' ({number} of {pages})' if pages > 1 else ''}",
        f"Shares of episodes that succeeded and failed by action count. {words}.",
        caption,
        footnotes([one.condition for one in drawn]),
        figure,
    )


def _incidence(
    actions: "NDArray[np.int64]", which: "NDArray[np.bool_]", longest: int
) -> "tuple[NDArray[np.int64], NDArray[np.float64]]":
    """Return numbers of actions, ascending, and the share of all episodes that ended so by then, up to the longest."""
    import numpy as np

    lengths, ended = np.unique(actions[which], return_counts=True)
    share = np.cumsum(ended) / len(actions)
    return np.append(lengths, longest), np.append(share, share[-1] if len(share) else 0.0)


def mileage(record: Record) -> Drawing | None:
    """Draw each robot's kilometres over its hours of driving; None before the first metre.

    Every attempt counts here, void ones too: the robot drove in them.
    """
    import numpy as np

    robots: dict[tuple[str, bool], list[int]] = {}
    for one in record.conditions:
        robots.setdefault((one.robot_title or one.robot, one.simulated), []).append(one.number)
    curves = []
    for (title, simulated), numbers in robots.items():
        rows = record.episodes[record.episodes["condition"].isin(numbers)]
        rows = rows[rows["path_length_m"].notna() & rows["duration_s"].notna()].sort_values("started_at")
        if rows["path_length_m"].sum() > 0:
            hours = np.cumsum(rows["duration_s"].to_numpy()) / 3600
            kilometres = np.cumsum(rows["path_length_m"].to_numpy()) / 1000
            keep = np.unique(np.linspace(0, len(hours) - 1, _MOST_POINTS).astype(int))
            curves.append((f"{title}, {'simulated' if simulated else 'real'}", hours[keep], kilometres[keep]))
    if not curves:
        return None
    with styled():
        figure = new_figure(COLUMN_IN, 2.0)
        axes = figure.subplots()
        lines, labels = [], []
        for index, (title, hours, kilometres) in enumerate(curves[:MOST_CONDITIONS]):
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
    caption = (
        "Distance over driving time on the robot's clock, over all attempts: the robot drove in the void ones too."
    )
    return Drawing("mileage", "Mileage", f"Distance over driving time. {words}.", caption, (), figure)
