"""Courses over time: how many episodes are still going after so many actions, and how far each robot has driven."""

from vsnbench.report.figures.style import (
    COLORS,
    COLUMN_IN,
    DASHES,
    MOST_CONDITIONS,
    Drawing,
    light_grid,
    new_figure,
    shown,
    styled,
)
from vsnbench.report.record import Record
from vsnbench.report.summary import Results

_MOST_POINTS = 2000
"""More points than that on a curve are no more seen."""


def survival(record: Record, results: Results) -> Drawing | None:
    """Draw the share of episodes that go on after each number of actions; None when no episode counts."""
    import numpy as np

    drawn = [one for one in results.conditions if one.total.episodes][:MOST_CONDITIONS]
    if not drawn:
        return None
    with styled():
        figure = new_figure(COLUMN_IN, 2.2 + 0.13 * len(drawn))
        axes = figure.subplots()
        longest = 1
        for index, one in enumerate(drawn):
            actions = np.sort(record.counted(one.condition)["actions"].to_numpy())
            lengths, ended = np.unique(actions, return_counts=True)
            left = 1 - np.cumsum(ended) / len(actions)
            longest = max(longest, int(lengths[-1]))
            axes.step(
                [0, *lengths],
                [100, *(100 * left)],
                where="post",
                color=COLORS[index],
                linestyle=DASHES[index],
                linewidth=1.1,
                label=f"{shown(one.condition.name)} (n = {len(actions)})",
            )
        axes.set_xlim(0, longest * 1.02)
        axes.set_ylim(0, 102)
        axes.set_xlabel("actions")
        axes.set_ylabel("episodes still going (%)")
        light_grid(axes, "both")
        figure.legend(loc="outside lower center", handlelength=3)
    words = "; ".join(f"{shown(one.condition.name, 80)}: mean {one.total.mean_actions:.0f} actions" for one in drawn)
    return Drawing("survival", "Episodes still going", f"Share of episodes going on by action count. {words}.", figure)


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
        figure = new_figure(COLUMN_IN, 2.1 + 0.23 * len(curves))
        axes = figure.subplots()
        for index, (title, hours, kilometres) in enumerate(curves[:MOST_CONDITIONS]):
            axes.plot(
                [0, *hours],
                [0, *kilometres],
                color=COLORS[index],
                linestyle=DASHES[index],
                linewidth=1.1,
                label=f"{shown(title, 50)}\n{kilometres[-1]:.2f} km in {hours[-1]:.2f} h",
            )
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.set_xlabel("driving time (h)")
        axes.set_ylabel("distance driven (km)")
        light_grid(axes, "both")
        figure.legend(loc="outside lower center", handlelength=3)
    words = "; ".join(f"{shown(title, 80)} {km[-1]:.2f} km in {h[-1]:.2f} h" for title, h, km in curves)
    return Drawing("mileage", "Mileage", f"Distance over driving time. {words}.", figure)
