"""Action histogram (paper, Figure 9), with readable values for rare actions."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from vsnbench.palette import COLORS
from vsnbench.report.analysis.activity import Rows
from vsnbench.report.analysis.comparability import kinds_note
from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.summary import ConditionSummary, ReportResults
from vsnbench.report.figures.style import (
    INK,
    Drawing,
    column_in,
    in_pages,
    light_grid,
    new_figure,
    page_in,
    panel_axes,
    styled,
)
from vsnbench.report.figures.text_layout import legend_below, shown, wrapped
from vsnbench.values.movement import TILTS, Action

MAX_PANELS = 6
"""Panels per figure."""
_LOOKS: tuple[dict[str, Any], ...] = (
    {"label": "chosen by the model", "color": COLORS[0]},
    {"label": "executed", "facecolor": "white", "edgecolor": COLORS[1], "hatch": "////"},
)

_Panel = tuple[ConditionSummary, Rows]


def action_histogram(results: ReportResults, actions: Rows) -> Iterator[Drawing]:
    """Draw one panel per condition with the chosen and the executed actions; nothing without actions."""
    panels = [
        (summary, mine)
        for summary in results.conditions
        if (mine := [usage for usage in actions if usage["condition"] == summary.condition.number])
    ]
    return in_pages(panels, MAX_PANELS, _drawing)


def _drawing(panels: Sequence[_Panel]) -> Drawing:
    columns = 1 if len(panels) == 1 else 2
    lines = -(-len(panels) // columns)
    tallest = max(len(_names(mine)) for _, mine in panels)
    with styled():
        figure = new_figure(column_in() if columns == 1 else page_in(), lines * (0.67 + 0.3 * tallest))
        grid = panel_axes(figure, len(panels), columns)
        for axes, (summary, mine) in zip(grid, panels, strict=True):
            names, both = _names(mine), _counts(mine)
            whole = sum(both[0].values())
            for series, (counts, look) in enumerate(zip(both, _LOOKS, strict=True)):
                places = [place + (series - 0.5) * 0.38 for place in range(len(names))]
                widths = [100 * counts[name] / whole for name in names]
                axes.barh(places, widths, height=0.34, linewidth=0.6, **look)
                for place, name, width in zip(places, names, widths, strict=True):
                    # The percentage is printed next to the bar, because bars of rare actions are too short to read.
                    axes.text(width + 1, place, f"{counts[name]:,} ({_share(width)} %)", va="center", fontsize=5.5)
            axes.set_yticks(range(len(names)), [shown(name, 24) for name in names])
            axes.set_ylim(len(names) - 0.45, -0.55)
            axes.set_xlim(0, 128)
            axes.set_xticks([0, 25, 50, 75, 100])
            axes.set_xlabel("% of the model's actions")
            title = wrapped(
                f"{summary.condition.name}: {summary.total.episodes} episodes", figure.get_figwidth() / columns - 1, 7.5
            )
            axes.set_title(title, loc="left", color=INK)
            light_grid(axes, "x")
        handles, labels = grid[0].get_legend_handles_labels()
        legend_below(figure, handles, labels)
    caption = (
        "Actions chosen by the model and actions executed, in percent of the model's actions over the counted episodes "
        "(paper, Figure 9). Blocked: stopped by the depth guard."
    )
    if note := kinds_note(summary.condition for summary, _ in panels):
        caption += f" {note}"
    return Drawing(
        "actions",
        "Chosen and executed actions",
        _alt(panels),
        caption,
        footnotes([summary.condition for summary, _ in panels]),
        figure,
    )


def _counts(mine: Rows) -> tuple[Counter[str], Counter[str]]:
    raw: Counter[str] = Counter()
    executed: Counter[str] = Counter()
    for usage in mine:
        raw[usage["raw_action"]] += usage["steps"]
        executed["blocked" if usage["blocked"] else usage["action"]] += usage["steps"]
    return raw, executed


def _names(mine: Rows) -> list[str]:
    """Return the actions of robots in their order, then the model's own, then the blocked ones."""
    seen = {usage["raw_action"] for usage in mine} | {usage["action"] for usage in mine if not usage["blocked"]}
    known = [action.value for action in Action if action.value in seen and action not in TILTS]
    blocked = ["blocked"] if any(usage["blocked"] for usage in mine) else []
    return [*known, *sorted(seen - set(known)), *blocked]


def _share(percent: float) -> str:
    return f"{percent:.1f}" if percent >= 0.1 or percent == 0 else f"{percent:.2g}"


def _alt(panels: Sequence[_Panel]) -> str:
    parts = []
    for summary, mine in panels:
        raw, _ = _counts(mine)
        whole = sum(raw.values())
        shares = ", ".join(
            f"{shown(name)} {count} ({_share(100 * count / whole)} %)" for name, count in raw.most_common()
        )
        parts.append(f"{shown(summary.condition.name)}: {shares}")
    return f"Histogram of actions. {'; '.join(parts)}."
