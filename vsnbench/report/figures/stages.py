"""Furthest stage of the episodes, one bar per condition."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from vsnbench.palette import SUCCESS
from vsnbench.protocol.course import Stage
from vsnbench.report.analysis.activity import Rows
from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.summary import ConditionSummary, ReportResults
from vsnbench.report.figures.style import INK, Drawing, in_pages, new_figure, page_in, styled
from vsnbench.report.figures.text_layout import legend_below, shown
from vsnbench.report.tables.success import SUMMARY

MAX_BARS = 20
"""Bars per figure."""
_LOOKS = {
    Stage.NONE: ("white", "////"),
    Stage.SEEN: ("#e9e6e0", ""),
    Stage.APPROACHED: ("#b3d4e8", ""),
    Stage.REACHED: ("#56B4E9", "...."),
    Stage.STOPPED: (SUCCESS, ""),
}
_LABELS = {
    Stage.NONE: "never in view",
    Stage.SEEN: "seen",
    Stage.APPROACHED: "approached",
    Stage.REACHED: "reached",
    Stage.STOPPED: "stopped there (success)",
}
_Bar = tuple[ConditionSummary, Mapping[str, Any]]


def stage_bars(results: ReportResults, courses: Rows) -> Iterator[Drawing]:
    """Draw the share of each furthest stage with the mean progress; nothing without known stages."""
    known = {course["condition"]: course for course in courses if course["stages"]}
    bars = [(summary, known[n]) for summary in results.conditions if (n := summary.condition.number) in known]
    return in_pages(bars, MAX_BARS, _drawing)


def _drawing(bars: Sequence[_Bar]) -> Drawing:
    from matplotlib.patches import Patch

    with styled():
        figure = new_figure(page_in(), 0.75 + 0.24 * len(bars))
        axes = figure.subplots()
        for place, (summary, course) in enumerate(bars):
            whole, left = sum(times for _, times in course["stages"].items()), 0.0
            for stage, times in course["stages"].items():
                color, hatch = _LOOKS[stage]
                width = 100 * times / whole
                axes.barh(place, width, left=left, height=0.62, color=color, hatch=hatch, edgecolor=INK, linewidth=0.4)
                left += width
            if math.isfinite(progress := SUMMARY.named("progress").value(summary.total)):
                axes.plot(100 * progress, place, marker="D", color=INK, markersize=3.5, linestyle="none")
        axes.set_yticks(range(len(bars)), [shown(summary.condition.name, 40) for summary, _ in bars])
        axes.set_ylim(len(bars) - 0.45, -0.55)
        axes.set_xlim(0, 100)
        axes.set_xlabel("% of the episodes; diamond: mean progress, % of the shortest path")
        samples = [Patch(facecolor=c, hatch=h, edgecolor=INK, linewidth=0.4) for c, h in _LOOKS.values()]
        legend_below(figure, samples, list(_LABELS.values()))
    words = "; ".join(
        f"{shown(summary.condition.name)}: "
        + ", ".join(f"{_LABELS[stage]} {times}" for stage, times in course["stages"].items())
        for summary, course in bars
    )
    return Drawing(
        "stages",
        "Furthest stage and progress",
        f"Bars of the furthest stage of the episodes. {words}.",
        "Furthest stage of each episode, from site map and poses. Progress is the covered share of the shortest path; "
        "it is not success.",
        footnotes([summary.condition for summary, _ in bars]),
        figure,
    )
