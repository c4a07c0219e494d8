"""Difference in success rate of every pair of models, with its interval."""

from collections.abc import Iterator, Sequence

from vsnbench.palette import SUCCESS
from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.comparison.question import ModelQuestion
from vsnbench.report.figures.style import FAINT, INK, Drawing, in_pages, light_grid, new_figure, page_in, styled
from vsnbench.report.figures.text_layout import shown, wrapped

_LABEL_PT = 6.5


def differences(questions: Sequence[ModelQuestion]) -> Iterator[Drawing]:
    """Draw the differences of all pairs, one figure per question; the better model is named first."""
    return in_pages([question for question in questions if question.pairs], 1, lambda page: _drawing(page[0]))


def _drawing(question: ModelQuestion) -> Drawing:
    width, parts = page_in() * 0.75, []
    with styled():
        rows = []
        for comparison, rate in question.pairs:
            names, sign = [comparison.first.name, comparison.second.name], 1.0
            if rate.difference < 0:
                names, sign = names[::-1], -1.0
            ends = sorted((sign * rate.interval.low, sign * rate.interval.high))
            rows.append((names, sign * rate.difference, ends, rate.conclusion.names_winner))
        rows.sort(key=lambda row: -row[1])
        labels = [wrapped(f"{names[0]} − {names[1]}", width * 0.42, _LABEL_PT) for names, *_ in rows]
        lines = [label.count("\n") + 1 for label in labels]
        figure = new_figure(width, 0.5 + sum(0.1 + 0.11 * line for line in lines))
        axes = figure.subplots()
        place, places = 0.0, []
        for (names, difference, (low, high), sure), line in zip(rows, lines, strict=True):
            places.append(place + (0.9 + line) / 2)
            place += 0.9 + line
            color = SUCCESS if sure else FAINT
            axes.plot([100 * low, 100 * high], [places[-1]] * 2, color=color, linewidth=1.2, solid_capstyle="butt")
            axes.plot(
                [100 * difference],
                [places[-1]],
                marker="o" if sure else "D",
                markersize=4,
                color=color,
                markerfacecolor=color if sure else "white",
            )
            finding = "different" if sure else "no difference shown"
            interval = f"[{100 * low:.1f}, {100 * high:.1f}]"
            parts.append(f"{shown(names[0])} minus {shown(names[1])}: {100 * difference:+.1f} {interval}, {finding}")
        axes.axvline(0, color=INK, linewidth=0.7)
        axes.set_yticks(places, labels, fontsize=_LABEL_PT)
        axes.tick_params(axis="y", length=0)
        axes.set_ylim(place, 0)
        axes.set_xlabel("difference in success rate (points), 95 % interval")
        light_grid(axes, "x")
    caption = (
        f"{question.where}: difference in success rate of every pair, on the shared goals and cells. Filled blue: "
        "a difference was shown, Holm-corrected for all pairs. Open grey: no difference was shown. The intervals "
        "of all pairs hold together with 95 %."
    )
    return Drawing(
        "differences",
        "Differences in success rate",
        f"Differences in success rate, points. {'; '.join(parts)}.",
        caption,
        footnotes([summary.condition for summary in question.members]),
        figure,
    )
