"""Causes of failures, and verdicts that operators overruled."""

import math
from collections.abc import Mapping
from typing import Any

from vsnbench.report.analysis.activity import Rows
from vsnbench.report.analysis.summary import ReportResults
from vsnbench.report.measures import (
    CELL,
    COUNT,
    COUNTS,
    FLAG,
    NUMBERS,
    RATIO,
    TEXT,
    Form,
    Measure,
    Measures,
    objects,
    percents,
)
from vsnbench.report.table import ReportTable, TableCell
from vsnbench.report.tables.activity import MODEL
from vsnbench.text.sanitize import sanitize

_NAMED = 5
"""Number of overruled verdicts named in a note."""
_METRES = Form({"type": "number"})
PLACES = Measures(
    Measure("kind", TEXT, "cause of these failures"),
    Measure("x_m", _METRES, "mean position in the site's frame: x"),
    Measure("y_m", _METRES, "mean position in the site's frame: y"),
    Measure("episodes", NUMBERS, "numbers of the failed episodes"),
)
_NEVER = "examined failures in which the goal was never in view"
_EXAMINED = "number of failed episodes whose cause was examined; at most 100"
_EXAMPLES = Measures(
    Measure("kind", TEXT, "cause of these failures"),
    Measure("description", TEXT, "the cause as a sentence"),
    Measure("episode", COUNT, "number of an episode that failed so, with images if one has them"),
    Measure("words", TEXT, "course of that episode"),
)
FAILURES = Measures(
    Measure("failed", COUNT, "number of failed episodes"),
    Measure("examined", COUNT, _EXAMINED),
    Measure("kinds", COUNTS, "cause → number of examined failures"),
    Measure("never_in_view", COUNT, _NEVER, null="if the poses are unknown"),
    Measure("touched", COUNTS, "touched object → number of examined collisions"),
    Measure("places", objects(PLACES), "places of failures, the most frequent first"),
    Measure("examples", objects(_EXAMPLES), "an example of each cause, the most frequent first"),
)
"""The JSON object of a condition's failures."""
_KINDS = Measures(
    MODEL,
    Measure("kind", TEXT, heading="kind"),
    Measure("episodes", COUNT, heading="episodes"),
    Measure("share", percents(1), heading="% of examined"),
)


def failure_table(results: ReportResults, failures: Rows) -> ReportTable | None:
    """Return the table of failure causes; None without failures."""
    names = {summary.condition.number: summary.condition.name for summary in results.conditions}
    rows, notes = [], []
    for found in failures:
        name, examined = names[found["condition"]], found["examined"]
        rows += [
            {"model": name, "kind": kind, "episodes": number, "share": number / examined}
            for kind, number in found["kinds"].items()
        ]
        if examined < found["failed"]:
            notes.append(f"{name}: {examined} of {found['failed']} failures, evenly sampled.")
        if found["never_in_view"] is not None:
            notes.append(f"{name}: the goal was never in view in {found['never_in_view']} of these failures.")
        if found["touched"]:
            things = ", ".join(f"{sanitize(thing)} {times}" for thing, times in found["touched"].items())
            notes.append(f"{name} collided with: {things}.")
    notes.append("From the poses and the site's walls; furniture does not block the view in this analysis.")
    return _KINDS.table("failures", "Why episodes failed", rows, notes=tuple(notes)) if rows else None


_NARRATIVE = Measures(
    MODEL,
    Measure("what", TEXT, heading="what happened"),
    Measure("episodes", RATIO, heading="episodes", note="of the examined failures"),
    Measure("example", CELL, heading="example"),
    Measure("picture", TEXT, heading="picture", note="file of `report --output`: five images of the example"),
)


def narrative_table(results: ReportResults, failures: Rows) -> ReportTable | None:
    """Return the failures of each model in words, with an example of each cause; None without failures."""
    names = {summary.condition.number: summary.condition.name for summary in results.conditions}
    rows = [
        {
            "model": names[found["condition"]],
            "what": example["description"],
            "episodes": (found["kinds"][example["kind"]], found["examined"]),
            "example": TableCell(
                f"Episode {example['episode']}, {sanitize(example['words'])}", example["episode"], (example["episode"],)
            ),
            "picture": picture_file(example["episode"]) if example["pictured"] else None,
        }
        for found in failures
        for example in found["examples"]
    ]
    notes = ("Causes by rule, from the poses and the site's walls; the example is the first episode with images.",)
    return _NARRATIVE.table("narrative", "Failures in words", rows, notes=notes) if rows else None


def picture_file(episode: int) -> str:
    """Return the file in which `report --output` writes the images of an example."""
    return f"pictures/episode-{episode}.jpg"


_CHANGES = {True: "success", False: "failure", None: "void"}
_OVERRULED = Measures(
    Measure("episode", COUNT, "number of the episode"),
    Measure("before", FLAG, "success according to the protocol", null="for void"),
    Measure("after", FLAG, "success according to the operator", null="for void"),
    Measure("author", TEXT, "name of the operator"),
    Measure("reason", TEXT, "note of the operator, or the verdict in words"),
)


def _overruled(after: bool | None) -> Measure:
    """Return the measure of the verdicts that became a success, a failure or void."""
    return Measure(
        "",
        COUNT,
        of=lambda row: sum(change["after"] is after for change in row["overruled"]),
        heading=f"to {_CHANGES[after]}",
    )


def _rate(judged: Mapping[str, Any]) -> float:
    return len(judged["overruled"]) / judged["judged"] if judged["judged"] else math.nan


_SHARE = "share of the judged episodes whose verdict the operator changed"
JUDGEMENTS = Measures(
    MODEL,
    Measure(
        "judged", COUNT, "number of episodes that an operator judged after the protocol", heading="judged", note=""
    ),
    Measure("", COUNT, of=lambda row: len(row["overruled"]), heading="overruled"),
    Measure("overrule_rate", percents(1), _SHARE, _rate, null="", heading="%", note=""),
    Measure("overruled", objects(_OVERRULED), "verdicts of the protocol that an operator changed"),
    *map(_overruled, _CHANGES),
)


def judgement_table(results: ReportResults, judgements: Rows) -> ReportTable | None:
    """Return the table of verdicts that operators overruled; None if no operator judged."""
    names = {summary.condition.number: summary.condition.name for summary in results.conditions}
    rows = [{**judged, "model": names[judged["condition"]]} for judged in judgements]
    notes = []
    for judged in rows:
        overruled = judged["overruled"]
        for change in overruled[:_NAMED]:
            became = {True: "a success", False: "a failure", None: "void"}[change["after"]]
            by = f"{sanitize(change['author'])}: {sanitize(change['reason'])}"
            notes.append(f"Episode {change['episode']}: {became} by {by}.")
        if len(overruled) > _NAMED:
            notes.append(f"{len(overruled) - _NAMED} more for {judged['model']}.")
    return JUDGEMENTS.table("judgements", "Verdicts by operators", rows, notes=tuple(notes)) if rows else None
