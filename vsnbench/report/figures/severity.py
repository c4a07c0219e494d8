"""Success rate against the severity of each disturbance of a stress test."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from vsnbench.palette import COLORS
from vsnbench.protocol.disturbances import SEVERITIES, STRESS_KINDS
from vsnbench.protocol.execution import CONTINUOUS
from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.comparison.stress import Loss, StressedModel
from vsnbench.report.figures.style import (
    DASHES,
    FAINT,
    INK,
    MARKERS,
    MAX_CONDITIONS,
    Drawing,
    light_grid,
    new_figure,
    page_in,
    styled,
)
from vsnbench.report.figures.text_layout import legend_below, shown
from vsnbench.statistics.clustered import rate_interval
from vsnbench.statistics.rates import UNKNOWN, Interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.container import ErrorbarContainer

_COLUMNS = 4
_PANEL_HEIGHT_IN = 1.45
_SCT = "SCT"
_SCT_NOTE = " SCT, success weighted by completion time, is a percentage with a scale of its own."


def success_by_severity(models: Sequence[StressedModel]) -> Drawing:
    """Draw a panel per disturbance with a line per model; severity 0 is undisturbed.

    Args:
        models: the first `MAX_CONDITIONS` are drawn.
    """
    drawn = models[:MAX_CONDITIONS]
    used = {loss.disturbance.name for model in drawn for loss in model.losses}
    contents = [(name, measure) for name in STRESS_KINDS if name in used for measure in _drawn_of(name, drawn)]
    columns = min(_COLUMNS, len(contents))
    lines = math.ceil(len(contents) / columns)
    with styled():
        figure = new_figure(page_in() * columns / _COLUMNS + 0.2, lines * _PANEL_HEIGHT_IN)
        panels = figure.subplots(lines, columns, sharex=True, squeeze=False)
        marks: list[ErrorbarContainer] = []
        for place, (axes, (name, measure)) in enumerate(zip(panels.flat, contents, strict=False)):
            marks = [_line(axes, model, name, measure, (index, len(drawn))) for index, model in enumerate(drawn)]
            _mark(axes, name, drawn)
            title = f"{measure} (%)" if measure else _title(name, drawn)
            _label(axes, title, is_last=place + columns >= len(contents), is_first=place % columns == 0)
            if measure:  # a small share, which has its own scale
                axes.set_ylim(0, 1.2 * axes.dataLim.y1 if axes.dataLim.y1 > 0 else 100)
                axes.tick_params(labelleft=True)
        for unused in panels.flat[len(contents) :]:
            unused.set_visible(False)
        several = len({model.undisturbed.condition.site for model in drawn}) > 1
        legend_below(figure, marks, [_model_name(model, with_site=several) for model in drawn])
    left_out = f" {len(models) - len(drawn)} more models are not drawn." if len(models) > len(drawn) else ""
    return Drawing(
        "success-by-severity",
        "Success by severity of each disturbance",
        _alt(drawn),
        "Success rate against the severity of each disturbance, with 95 % intervals clustered by starting position. "
        "Severity 0 is undisturbed; the same trials at every severity. The title of a panel has the values."
        f"{_SCT_NOTE if (CONTINUOUS, _SCT) in contents else ''}{left_out}{_unseen(drawn)}",
        footnotes([model.undisturbed.condition for model in drawn]),
        figure,
    )


def _drawn_of(name: str, models: Sequence[StressedModel]) -> tuple[str, ...]:
    """Return what is drawn of a disturbance: the success rate, and of continuous execution what time it costs."""
    has_sct = any(effect.measure == _SCT for model in models for loss in model.losses for effect in loss.effects)
    return ("", _SCT) if name == CONTINUOUS and has_sct else ("",)


def _line(axes: "Axes", model: StressedModel, name: str, measure: str, order: tuple[int, int]) -> "ErrorbarContainer":
    """Draw a model's success rate, or its mean of another measure.

    Args:
        axes: where.
        model: the model.
        name: the disturbance.
        measure: another measure than the success rate; empty for that.
        order: number of the model, from 0, and number of models.
    """
    own = [loss for loss in model.losses if loss.disturbance.name == name and loss.disturbance.severity is not None]
    index, models = order
    if measure:
        pairs = [next((effect for effect in loss.effects if effect.measure == measure), None) for loss in own]
        means = [(math.nan, math.nan) if pair is None else (pair.first, pair.second) for pair in pairs]
        rates = [means[0][0] if means else math.nan, *(mean for _, mean in means)]
        intervals = [UNKNOWN] * len(rates)
    else:
        rates = [model.undisturbed.total.success_rate, *(loss.rate.compared[1].rate for loss in own)]
        intervals = [model.undisturbed.total.interval, *(_interval(loss) for loss in own)]
    shift = (index - (models - 1) / 2) * 0.12  # so that the intervals of models do not cover each other
    return axes.errorbar(
        [0 + shift, *((loss.disturbance.severity or 0) + shift for loss in own)],
        [100 * rate for rate in rates],
        yerr=[
            [100 * (rate - interval.low) for rate, interval in zip(rates, intervals, strict=True)],
            [100 * (interval.high - rate) for rate, interval in zip(rates, intervals, strict=True)],
        ],
        color=COLORS[index],
        marker=MARKERS[index],
        linestyle=DASHES[index],
        markersize=3,
        linewidth=0.9,
        elinewidth=0.5,
        capsize=1.2,
        capthick=0.5,
    )


def _mark(axes: "Axes", name: str, models: Sequence[StressedModel]) -> None:
    """Write which models do not see a disturbance, and which it did not change in any trial."""
    words = {"not seen by": [model for model in models if name in model.unseen]}
    words["no trial changed:"] = [model for model in models if name in model.untouched]
    text = "\n".join(f"{what} {', '.join(map(_short_name, some))}" for what, some in words.items() if some)
    axes.text(0.97, 0.04, text, transform=axes.transAxes, ha="right", va="bottom", fontsize=5.5, color=INK)


def _unseen(models: Sequence[StressedModel]) -> str:
    """Return a sentence about the disturbances that models do not use; empty without any."""
    parts = [f"{_short_name(model)}: {', '.join(model.unseen)}" for model in models if model.unseen]
    return f" Left out, because the model does not use what they change: {'; '.join(parts)}." if parts else ""


def _short_name(model: StressedModel) -> str:
    return shown(model.undisturbed.condition.model, 24)


def _interval(loss: Loss) -> Interval:
    pairing = loss.rate.pairing
    return rate_interval(pairing.outcomes.second) if pairing else UNKNOWN


def _model_name(model: StressedModel, *, with_site: bool) -> str:
    condition = model.undisturbed.condition
    return shown(f"{condition.model} in {condition.site}" if with_site else condition.model)


def _title(name: str, models: Sequence[StressedModel]) -> str:
    """Return the name of a disturbance with its values in ascending severity."""
    own = {loss.disturbance for model in models for loss in model.losses if loss.disturbance.name == name}
    values = ", ".join(f"{member.value:g}" for member in sorted(own, key=lambda member: abs(member.value)))
    unit = STRESS_KINDS[name].unit
    return f"{name}: {values}{'' if unit == 'share' else f' {unit}'}"


def _label(axes: "Axes", title: str, *, is_last: bool, is_first: bool) -> None:
    axes.set_title(title)
    axes.set_xticks([0, *SEVERITIES])
    axes.set_xlim(-0.4, SEVERITIES[-1] + 0.4)
    axes.set_ylim(-3, 103)
    axes.axhline(0, color=FAINT, linewidth=0.4)
    light_grid(axes, "y")
    axes.tick_params(labelbottom=is_last, labelleft=is_first)
    if is_last:
        axes.set_xlabel("severity")
    if is_first:
        axes.set_ylabel("success rate (%)")


def _alt(models: Sequence[StressedModel]) -> str:
    parts = []
    for model in models:
        worst = ", ".join(f"{harm.name} {100 * harm.mean_loss:.0f} points" for harm in model.most_harmful) or "none"
        parts.append(
            f"{_model_name(model, with_site=True)}: {100 * model.undisturbed.total.success_rate:.0f} percent "
            f"undisturbed; largest mean losses: {worst}"
        )
    return f"Success rate by severity of each disturbance. {'. '.join(parts)}."
