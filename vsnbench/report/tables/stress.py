"""Losses by disturbances: measures and tables."""

from collections.abc import Sequence

from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.comparison.stress import Harm, Loss, StressedModel
from vsnbench.report.measures import (
    COUNT,
    NUMBER,
    NUMBERS,
    RATIO,
    TEXT,
    TEXTS,
    Form,
    Measure,
    Measures,
    P,
    an_object,
    decimals,
    intervals,
    objects,
    percents,
)
from vsnbench.report.table import EMPTY, ReportTable, TableCell, of, percent, row, without_empty_columns
from vsnbench.report.tables.conditions import CONDITION
from vsnbench.report.tables.success import GROUP
from vsnbench.statistics.conclusion import Conclusion
from vsnbench.statistics.rates import Proportion

_SEVERITY = Form({"type": "integer"}, lambda severity: TableCell(str(severity), severity), number=False)
_PLAIN = Form({"type": "number"})
_LOST = Measures(
    Measure("goal", TEXT, "goal of the trial"),
    Measure("start", COUNT, "number of the starting position"),
    Measure("undisturbed", COUNT, "number of the undisturbed episode"),
    Measure("disturbed", COUNT, "number of the disturbed episode"),
)
_EFFECT = Measures(
    Measure("measure", TEXT, "`SPL` or `progress`; for `continuous` also `SCT` and `driving time (s)`"),
    Measure("undisturbed", NUMBER, "mean without the disturbance", "first"),
    Measure("disturbed", NUMBER, "mean with the disturbance", "second"),
    Measure("loss", NUMBER, "undisturbed minus disturbed mean", "difference"),
    Measure("ci", intervals(), "the 95 % interval of the loss", "interval"),
)


def _disturbed(loss: Loss) -> Proportion:
    return loss.rate.compared[1]


def _effect_loss(name: str) -> Measure:
    """Return the measure of the loss in another quantity, which tables show where a model has it."""

    def loss_of(loss: Loss) -> float | None:
        return next((effect.difference for effect in loss.effects if effect.measure == name), None)

    return Measure("", decimals(3), of=loss_of, heading=f"{name} loss", rank=4)


_VALUE = "strength at this severity, in `unit`"
_LOSS = "undisturbed minus disturbed success rate, in the cells that both have"
_LOSS_NOTE = "undisturbed minus disturbed success rate, points, over the same cells"
_INTERVAL_NOTE = "of the loss, points; paired and clustered by starting position"
_CONCLUSION = "`first better` where a loss is shown, `second better` where a gain is shown"
_HOLM = "p-value after Holm's correction for all disturbances of the model"
_CHANGED, _CHANGED_NOTE = (
    "matched trials whose success or number of actions differs",
    "trials whose success or number of actions differs",
)


def _losses(measures: Sequence[str] = ()) -> Measures:
    """Return the measures of a `Loss`, with the losses in some other quantities as columns."""
    return Measures(
        Measure("disturbance", TEXT, "name of the disturbance", "disturbance.name", heading="disturbance", note=""),
        Measure("severity", _SEVERITY, "severity, from 1", "disturbance.severity", heading="severity", note=""),
        Measure(
            "",
            TEXT,
            of=lambda loss: f"{loss.disturbance.value:g} {loss.disturbance.kind.unit}",
            heading="value",
            rank=1,
        ),
        Measure("value", _PLAIN, _VALUE, "disturbance.value"),
        Measure("unit", TEXT, "unit of `value`", "disturbance.kind.unit"),
        Measure("campaigns", NUMBERS, "numbers of the pooled disturbed campaigns"),
        Measure(
            "successes",
            COUNT,
            "successes with the disturbance, in the compared cells",
            lambda loss: _disturbed(loss).successes,
        ),
        Measure("episodes", COUNT, "compared episodes with the disturbance", lambda loss: _disturbed(loss).trials),
        Measure("", RATIO, of=lambda loss: (_disturbed(loss).successes, _disturbed(loss).trials), heading="k/n"),
        Measure(
            "success_rate",
            percents(1),
            "share of successes with the disturbance",
            lambda loss: _disturbed(loss).rate,
            null="without episodes",
            heading="SR %",
            note="",
            rank=2,
        ),
        Measure(
            "loss", decimals(1, 100), _LOSS, "rate.difference", null="without any", heading="loss", note=_LOSS_NOTE
        ),
        Measure(
            "ci",
            intervals(1),
            "the 95 % interval of the loss",
            "rate.interval",
            heading="95 % interval",
            note=_INTERVAL_NOTE,
        ),
        Measure("p", NUMBER, "p-value before correction", "rate.p"),
        Measure(
            "adjusted_p",
            P,
            _HOLM,
            "rate.adjusted_p",
            heading="Holm p",
            note="two-sided, corrected for all rows of the table",
        ),
        Measure("conclusion", TEXT, _CONCLUSION, "rate.conclusion"),
        Measure("effects", objects(_EFFECT), "losses in other measures, one object each"),
        *map(_effect_loss, measures),
        Measure("changed", COUNT, _CHANGED),
        Measure("matched", COUNT, "number of trials with a result under both conditions"),
        Measure("", RATIO, _CHANGED_NOTE, lambda loss: (loss.changed, loss.matched), heading="changed", rank=3),
        Measure("lost", objects(_LOST), "trials that succeeded undisturbed and failed disturbed"),
    )


_HARM = Measures(
    Measure("disturbance", TEXT, "name of the disturbance", "name"),
    Measure("mean_loss", _PLAIN, "mean loss of success rate over its severities"),
    Measure("examples", objects(_LOST), "at most three lost trials"),
)
_UNSEEN = "disturbances that were left out because the model does not use what they change"
STRESSED = Measures(
    *CONDITION.within("undisturbed.condition"),
    Measure("campaigns", NUMBERS, "numbers of the pooled undisturbed campaigns", "undisturbed.condition.campaigns"),
    Measure("undisturbed", an_object(GROUP), "summary of the trials without disturbances", "undisturbed.total"),
    Measure("unseen", TEXTS, _UNSEEN),
    Measure("disturbances", objects(_losses()), "one object per disturbance and severity", "losses"),
    Measure("most_harmful", objects(_HARM), "disturbances with the largest mean losses, at most three"),
)
"""The JSON object of a `StressedModel`: rates from 0 to 1."""


def stress_table(model: StressedModel) -> ReportTable:
    """Return the losses of a model, one row per disturbance and severity."""
    condition, total = model.undisturbed.condition, model.undisturbed.total
    measures = _losses(list(dict.fromkeys(effect.measure for loss in model.losses for effect in loss.effects)))
    rate = (of(total.successes, total.episodes), percent(total.success_rate, 1))
    blank = [EMPTY] * (len(measures.columns) - 5)
    undisturbed = row("undisturbed", EMPTY, "", *rate, *blank)
    unseen = [row(name, EMPTY, "", "not seen", EMPTY, *blank) for name in model.unseen]
    return without_empty_columns(
        ReportTable(
            name=f"stress-{condition.number}",
            title=f"{condition.model} in {condition.site}: loss of success by disturbance",
            columns=measures.columns,
            rows=(undisturbed, *map(measures.row, model.losses), *unseen),
            notes=_notes(model),
            footnotes=footnotes([condition]),
        )
    )


def _notes(model: StressedModel) -> tuple[str, ...]:
    harms = [f"{number}. {_harm_text(harm)}" for number, harm in enumerate(model.most_harmful, start=1)]
    heading = "Largest mean losses over the severities:" if harms else "No disturbance has a mean loss."
    unseen = (
        f"Not seen: {', '.join(model.unseen)}. The model does not use what they change, so they were left out: its "
        "success without them does not show that it is robust."
    )
    unchanged = (
        f"Every trial has the same success and number of actions under {', '.join(model.untouched)}: the model may not "
        "use what they change, so this does not show that it is robust."
    )
    shown = [*_shown(model, Conclusion.FIRST_BETTER, "loss"), *_shown(model, Conclusion.SECOND_BETTER, "gain")]
    return (
        *shown,
        heading,
        *harms,
        *([unseen] if model.unseen else []),
        *([unchanged] if model.untouched else []),
    )


def _shown(model: StressedModel, conclusion: Conclusion, what: str) -> list[str]:
    """Return in a sentence which disturbances change success, by test and interval."""
    found = [loss.disturbance for loss in model.losses if loss.rate.conclusion is conclusion]
    names = ", ".join(f"{member.name}@{member.severity}" for member in found)
    if not found and what == "loss":
        return ["No loss is shown: none has an interval above 0 and a Holm p of at most 0.05."]
    return [f"A {what} of success is shown, by interval and Holm p: {names}."] if found else []


def _harm_text(harm: Harm) -> str:
    examples = ", ".join(
        f"{trial.goal} from {trial.start} (episode {trial.disturbed}, undisturbed {trial.undisturbed})"
        for trial in harm.examples
    )
    return f"{harm.name}: {100 * harm.mean_loss:.1f} points{f'; lost: {examples}' if examples else ''}"
