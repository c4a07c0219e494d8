"""Losses by disturbances as tables and JSON values."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.fields import condition_fields, finite, interval_fields
from vsnbench.report.comparison.effects import EffectComparison
from vsnbench.report.comparison.stress import Harm, Loss, StressedModel
from vsnbench.report.table import (
    EMPTY,
    Column,
    ReportTable,
    Row,
    decimal,
    interval_percent,
    of,
    p_cell,
    percent,
    row,
    without_empty_columns,
)
from vsnbench.report.tables.success import GROUP
from vsnbench.statistics.conclusion import Conclusion


def stress_table(model: StressedModel) -> ReportTable:
    """Return the losses of a model, one row per disturbance and severity."""
    condition = model.undisturbed.condition
    measures = dict.fromkeys(effect.measure for loss in model.losses for effect in loss.effects)
    return without_empty_columns(
        ReportTable(
            name=f"stress-{condition.number}",
            title=f"{condition.model} in {condition.site}: loss of success by disturbance",
            columns=(
                Column("disturbance", number=False),
                Column("severity", number=False),
                Column("value", number=False, rank=1),
                Column("k/n"),
                Column("SR %", rank=2),
                Column("loss", note="undisturbed minus disturbed success rate, points, over the same cells"),
                Column("95 % interval", note="of the loss, points; paired and clustered by starting position"),
                Column("Holm p", note="two-sided, corrected for all rows of the table"),
                *(Column(f"{measure} loss", rank=4) for measure in measures),
                Column("changed", rank=3, note="trials whose success or number of actions differs"),
            ),
            rows=(
                _undisturbed_row(model, len(measures)),
                *(_row(loss, list(measures)) for loss in model.losses),
                *(row(name, EMPTY, "", "not seen", *[EMPTY] * (5 + len(measures))) for name in model.unseen),
            ),
            notes=_notes(model),
            footnotes=footnotes([condition]),
        )
    )


def stress_fields(models: Sequence[StressedModel]) -> list[dict[str, Any]]:
    """Return the losses as JSON values: rates from 0 to 1, None if unknown."""
    return [
        {
            **condition_fields(model.undisturbed.condition),
            "campaigns": list(model.undisturbed.condition.campaigns),
            "undisturbed": GROUP.fields(model.undisturbed.total),
            "unseen": list(model.unseen),
            "disturbances": [_loss_fields(loss) for loss in model.losses],
            "most_harmful": [
                {
                    "disturbance": harm.name,
                    "mean_loss": finite(harm.mean_loss),
                    "examples": [asdict(trial) for trial in harm.examples],
                }
                for harm in model.most_harmful
            ],
        }
        for model in models
    ]


def _undisturbed_row(model: StressedModel, measures: int) -> Row:
    total = model.undisturbed.total
    return row(
        "undisturbed",
        EMPTY,
        "",
        of(total.successes, total.episodes),
        percent(total.success_rate, 1),
        *[EMPTY] * (4 + measures),
    )


def _row(loss: Loss, measures: Sequence[str]) -> Row:
    disturbance, rate = loss.disturbance, loss.rate
    disturbed = rate.compared[1]
    effects = {effect.measure: effect for effect in loss.effects}
    return row(
        disturbance.name,
        disturbance.severity,
        f"{disturbance.value:g} {disturbance.kind.unit}",
        of(disturbed.successes, disturbed.trials),
        percent(disturbed.rate, 1),
        decimal(100 * rate.difference, 1),
        interval_percent(rate.interval, 1),
        p_cell(rate.adjusted_p),
        *(decimal(effects[name].difference, 3) if name in effects else EMPTY for name in measures),
        of(loss.changed, loss.matched),
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


def _loss_fields(loss: Loss) -> dict[str, Any]:
    rate, disturbed = loss.rate, loss.rate.compared[1]
    return {
        "disturbance": loss.disturbance.name,
        "severity": loss.disturbance.severity,
        "value": loss.disturbance.value,
        "unit": loss.disturbance.kind.unit,
        "campaigns": list(loss.campaigns),
        "successes": disturbed.successes,
        "episodes": disturbed.trials,
        "success_rate": finite(disturbed.rate),
        "loss": finite(rate.difference),
        **interval_fields(rate.interval),
        "p": finite(rate.p),
        "adjusted_p": finite(rate.adjusted_p),
        "conclusion": rate.conclusion.value,
        "effects": [_effect_fields(effect) for effect in loss.effects],
        "changed": loss.changed,
        "matched": loss.matched,
        "lost": [asdict(trial) for trial in loss.lost],
    }


def _effect_fields(effect: EffectComparison) -> dict[str, Any]:
    return {
        "measure": effect.measure,
        "undisturbed": finite(effect.first),
        "disturbed": finite(effect.second),
        "loss": finite(effect.difference),
        **interval_fields(effect.interval),
    }
