"""The action histogram (paper, Figure 9): what the model chose and what the robot did, rare actions readable too."""

from collections import Counter
from collections.abc import Iterator, Sequence

from vsnbench.protocol.actions import Action
from vsnbench.report.activity import ActionCount
from vsnbench.report.conditions import footnotes
from vsnbench.report.figures.lettering import legend_below, shown, wrapped
from vsnbench.report.figures.style import (
    COLORS,
    COLUMN_IN,
    INK,
    PAGE_IN,
    Drawing,
    in_pages,
    light_grid,
    new_figure,
    page_name,
    styled,
)
from vsnbench.report.summary import ConditionSummary, Results

MOST_PANELS = 6
"""To a figure."""


_Panel = tuple[ConditionSummary, Sequence[ActionCount]]


def action_histogram(results: Results, actions: Sequence[ActionCount]) -> Iterator[Drawing]:
    """Draw one panel a condition: the model's own actions, and those that were executed; nothing for no actions."""
    panels = [
        (one, mine)
        for one in results.conditions
        if (mine := [each for each in actions if each.condition == one.condition.number])
    ]
    pages = in_pages(panels, MOST_PANELS)
    for number, page in enumerate(pages, start=1):
        yield _drawing(page, number, len(pages))


def _drawing(panels: Sequence[_Panel], number: int, pages: int) -> Drawing:
    columns = 1 if len(panels) == 1 else 2
    lines = -(-len(panels) // columns)
    tallest = max(len(_names(mine)) for _, mine in panels)
    with styled():
        figure = new_figure(COLUMN_IN if columns == 1 else PAGE_IN, lines * (0.67 + 0.3 * tallest))
        grid = figure.subplots(lines, columns, squeeze=False)
        for axes in grid.flat[len(panels) :]:
            axes.set_axis_off()
        for axes, (one, mine) in zip(grid.flat, panels, strict=False):
            raw, executed = _counts(mine)
            names = _names(mine)
            whole = sum(raw.values())
            for series, (counts, label, look) in enumerate(
                (
                    (raw, "chosen by the model", {"color": COLORS[0]}),
                    (executed, "executed", {"facecolor": "white", "edgecolor": COLORS[1], "hatch": "////"}),
                )
            ):
                places = [place + (series - 0.5) * 0.38 for place in range(len(names))]
                widths = [100 * counts[name] / whole for name in names]
                axes.barh(places, widths, height=0.34, linewidth=0.6, label=label, **look)
                for place, name, width in zip(places, names, widths, strict=True):
                    # A share is printed beside its bar: STOP is no taller than a hair, and is to be read.
                    axes.text(width + 1, place, f"{counts[name]:,} ({_share(width)} %)", va="center", fontsize=5.5)
            axes.set_yticks(range(len(names)), [shown(name, 24) for name in names])
            axes.set_ylim(len(names) - 0.45, -0.55)
            axes.set_xlim(0, 128)
            axes.set_xticks([0, 25, 50, 75, 100])
            axes.set_xlabel("% of the model's actions")
            title = wrapped(
                f"{one.condition.name}: {one.total.episodes} episodes", figure.get_figwidth() / columns - 1, 7.5
            )
            axes.set_title(title, loc="left", color=INK)
            light_grid(axes, "x")
        handles, labels = grid.flat[0].get_legend_handles_labels()
        legend_below(figure, handles, labels)
    caption = (
        "What the model chose, and what was executed, in percent of the model's actions over the episodes that count "
        "(paper, Figure 9). Blocked: refused by the depth guard."
    )
    return Drawing(
        page_name("actions", number),
        f"Actions chosen and executed{f' ({number} of {pages})' if pages > 1 else ''}",
        _alt(panels),
        caption,
        footnotes([one.condition for one, _ in panels]),
        figure,
    )


def _counts(mine: Sequence[ActionCount]) -> tuple[Counter[str], Counter[str]]:
    raw: Counter[str] = Counter()
    executed: Counter[str] = Counter()
    for each in mine:
        raw[each.raw_action] += each.steps
        executed["blocked" if each.blocked else each.action] += each.steps
    return raw, executed


def _names(mine: Sequence[ActionCount]) -> list[str]:
    """The protocol's actions first and in its order, then the model's own, then what the guard refused."""
    seen = {each.raw_action for each in mine} | {each.action for each in mine if not each.blocked}
    known = [action.value for action in Action if action.value in seen]
    blocked = ["blocked"] if any(each.blocked for each in mine) else []
    return [*known, *sorted(seen - set(known)), *blocked]


def _share(percent: float) -> str:
    return f"{percent:.1f}" if percent >= 0.1 or percent == 0 else f"{percent:.2g}"


def _alt(panels: Sequence[_Panel]) -> str:
    parts = []
    for one, mine in panels:
        raw, _ = _counts(mine)
        whole = sum(raw.values())
        shares = ", ".join(
            f"{shown(name)} {count} ({_share(100 * count / whole)} %)" for name, count in raw.most_common()
        )
        parts.append(f"{shown(one.condition.name)}: {shares}")
    return f"Histogram of actions. {'; '.join(parts)}."
