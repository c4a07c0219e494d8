"""Text about a study before it runs: its arms, warnings, power and duration."""

import math
import re
from collections.abc import Iterator, Sequence

from vsnbench.errors import RecordError
from vsnbench.report.measures import TEXT, TEXTS, Form, Measure, Measures, known, objects
from vsnbench.report.study.pilot import PILOT
from vsnbench.report.table import ReportTable, decimal, percent
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.studies.entries import LockedArm
from vsnbench.results.studies.queries import trial_duration_s
from vsnbench.runner.study.arms import StudyPlace
from vsnbench.study.file import StudyFile
from vsnbench.study.looks import looks_of
from vsnbench.study.power import (
    DIFFERENCES,
    PlannedPower,
    design_of_study,
    needed_starts,
    pairs_of,
    planned_power,
    simulated_studies,
)
from vsnbench.study.stopping import min_units
from vsnbench.study.units import unit_rule
from vsnbench.text.sanitize import counted, duration_text


def arm_lines(arms: Sequence[LockedArm]) -> Iterator[str]:
    """Yield one line per arm: its model, weights and number of trials."""
    width = max(len(arm.name) for arm in arms)
    for arm in arms:
        model = arm.plan.model
        weights = f", {model.weights_label or 'weights'} ({model.weights_sha256[:12]})" if model.weights_sha256 else ""
        bound = "; receives the site: an upper bound, not a competitor" if model.surveyed else ""
        yield f"{arm.name:<{width}}  {model.name}{weights}: {len(arm.plan.trials)} trials{bound}"


def arm_fields(arms: Sequence[LockedArm]) -> list[dict[str, object]]:
    """Return the same as JSON fields."""
    return [
        {
            "name": arm.name,
            "model": arm.plan.model.name,
            "weights": arm.plan.model.weights_label or None,
            "weights_sha256": arm.plan.model.weights_sha256 or None,
            "trials": len(arm.plan.trials),
            "upper_bound": arm.plan.model.surveyed,
        }
        for arm in arms
    ]


def warnings_of(place: StudyPlace) -> Iterator[str]:
    """Yield what reveals the arms to an operator, and weaknesses of the design."""
    study = place.study
    if study.blind:
        names = {name.lower() for name in study.arms} | {arm.model.lower() for arm in study.arms.values()}
        for field in ("title", "question", "notes"):
            found = set(re.findall(r"[a-z0-9_.-]+", getattr(study, field).lower())) & names
            if found:
                yield f"{field} names {', '.join(sorted(found))}, and operators see it while the study is blind"
        if any(arm.goals for arm in study.arms.values()):
            yield "goals of single arms reveal these arms while the study is blind"
    if study.order == "as-planned":
        yield "as-planned runs one arm after another: drift (battery, light, floor) looks like a difference"
    if study.stopping == "decided" and study.of_these_cells:
        yield (
            "about: these-cells says which arm succeeded more often in this plan's trials, not which model is better: "
            "of equal models with random outcomes it names one in about half of the studies; test: sign-flips does not"
        )
    elif study.about is not None:
        yield (
            "test: bets about cells-like-these finds fewer differences than test: sign-flips with the same positions; "
            "use it only to continue an earlier plan"
        )


def powers_of(place: StudyPlace, rate: float) -> Sequence[PlannedPower]:
    """Return the power of a design for several true differences."""
    study = place.study
    starts = len({trial.start for trial in place.schedule.trials})
    differences = {*DIFFERENCES, study.difference} if not study.of_margin else _around(study.margin)
    return planned_power(study, design_of_study(study, starts, rate), tuple(sorted(differences)))


def _around(margin: float) -> set[float]:
    """Return the true differences for which the power of equivalence and non-inferiority is shown."""
    return {0.0, margin / 2, margin, min(1.0, 1.5 * margin)}


def power_table(place: StudyPlace, rate: float, powers: Sequence[PlannedPower]) -> ReportTable:
    """Return the table of the power of a design."""
    study = place.study
    starts = len({trial.start for trial in place.schedule.trials})
    goals, repetitions = counted(len(study.goals), "goal"), counted(study.repetitions, "repetition")
    size = f"{counted(starts, 'starting position')}, {goals}, {repetitions}"
    studies = simulated_studies(study, starts)
    level = f"alpha {study.alpha:g} over {counted(pairs_of(study), 'question')}"
    error = f"standard errors of up to {50 / math.sqrt(studies):.1f} points"
    notes = [
        f"{size}; mean rate {rate:.0%}; {level}. Each line is from {studies:,} simulated studies: {error}.",
        "Assumed: cells differ in difficulty (correlation 0.3; 0.1 across goals), half of it shared by both models.",
    ]
    if study.of_progress:
        notes.append("The power is that of success alone; the primary analysis is of progress.")
    if study.real_cells is not None:
        notes.append(
            f"Of a plan with real trials in all cells, not in {study.real_cells}: what a planned twin saves depends on "
            "how well it predicts."
        )
    if study.of_margin:
        notes += _margin_notes(study)
    elif study.margin:
        notes.append(f"A difference counts if it is larger than the margin of {study.margin:.0%}.")
    assumed = 0.0 if study.of_margin else study.difference
    smallest = next((power.difference for power in powers if power.power >= study.power), None)
    planned = next(power for power in powers if power.difference == assumed)
    if study.stopping == "decided":
        notes += _stopping_notes(place, planned)
    if planned.power < study.power:
        detectable = f" The smallest difference with this power is {smallest:.0%}." if smallest else ""
        needed = needed_starts(study, design_of_study(study, starts, rate)) if not study.about else None
        if needed:
            detectable += f" A whole plan needs about {needed} starting positions for it."
        remedy = "more starting positions" if study.by_starting_position else "more positions or repetitions"
        notes.append(
            f"The power for the difference of {assumed:.0%} is {planned.power:.0%}, less than the "
            f"{study.power:.0%} of the plan.{detectable} Use {remedy}."
        )
    if study.of_these_cells:
        notes.append(
            "These studies name the arm that succeeded more often in their trials. The outcomes here are random within "
            "a cell, so that this is often one of two equal arms."
        )
    if fault := place.design_error:
        notes.append(f"This design cannot show a difference: {fault}.")
    return POWER.table("power", "Power of this design", powers, notes=tuple(notes))


def _margin_notes(study: StudyFile) -> Iterator[str]:
    """Yield what the lines mean for equivalence and non-inferiority."""
    points = f"{100 * study.margin:g} points"
    if study.primary.kind == "equivalence":
        yield f"Power: studies that show a difference below {points}. Wrong: the same where the difference reaches it."
    else:
        yield (
            f"The true difference is how much worse the arm is. Power: studies that show less than {points}. Wrong: "
            "the same where the difference reaches it."
        )


_POWER_NOTE = "Share of studies that name the better arm."
_WRONG_NOTE = "Share of studies that name the worse arm, or any arm of two equal ones."
_BLOCKS_NOTE = "Mean number of blocks; a block is every arm once on one cell and repetition."
_WRONG = "simulated studies that name the worse arm, or any arm if the difference is 0, percent"


def _percent(places: int) -> Form:
    return Form({"type": "number"}, lambda share: percent(share, places), json=lambda share: known(100 * share))


POWER = Measures(
    Measure(
        "difference_percent",
        _percent(0),
        "true difference of the success rates, percent",
        "difference",
        heading="true difference %",
        note="",
    ),
    Measure(
        "power_percent",
        _percent(0),
        "simulated studies that name the better arm, percent",
        "power",
        null="for a difference of 0",
        heading="power %",
        note=_POWER_NOTE,
    ),
    Measure("wrong_percent", _percent(1), _WRONG, "wrong", heading="wrong %", note=_WRONG_NOTE),
    Measure(
        "blocks",
        Form({"type": "number"}, lambda blocks: decimal(blocks, 0), json=float),
        "mean number of blocks that a study runs",
        heading="blocks run",
        note=_BLOCKS_NOTE,
    ),
)
"""Measures of a `PlannedPower`."""
PLAN = Measures(
    Measure("rate", Form({"type": "number"}), "assumed mean success rate"),
    Measure("power", objects(POWER), "power by simulation, one object per difference"),
    Measure("notes", TEXTS, "remarks, one sentence each"),
    Measure("pace", TEXT, "estimated duration of the whole plan in words, or how to get an estimate"),
    Measure("pilot", objects(PILOT), "recorded pairs of models in the study's cells", only_in="a study on progress"),
)
"""The JSON object of `study plan`."""


def _stopping_notes(place: StudyPlace, planned: PlannedPower) -> Iterator[str]:
    """Yield when a study with `stopping: decided` can end, and what it assumes.

    Args:
        place: site and schedule of the study.
        planned: power at the difference of the plan.
    """
    study, rule = place.study, unit_rule(place.study, place.shared_blocks)
    assumed = 0.0 if study.of_margin else study.difference
    fewest = min_units(study, place.shared_blocks)
    earliest = f"not before {counted(fewest, rule.name)} of {rule.planned}" if fewest else "by no test"
    typical = f"typically after {planned.decided_at:.0f}" if planned.decided_at is not None else "rarely before the end"
    when = f"every {rule.name}"
    if study.by_looks:
        when = f"{', '.join(str(look) for look in looks_of(study, rule.planned))} complete starting positions"
    yield (
        f"Analysed after {when}: decided {earliest}, even with the clearest results, and {typical} for a true "
        f"difference of {assumed:.0%}."
    )
    if study.by_starting_position:
        yield (
            "All goals and repetitions of a starting position count as one value. Assumed: the starting positions are "
            "random draws from those that the conclusion is about."
        )


def duration_line(place: StudyPlace, results: ResultsDirectory, seconds: float | None) -> str:
    """Return the duration of the whole plan, from a given duration of a trial or the median in the record."""
    trials, source = len(place.schedule.trials), "as given"
    if seconds is None:
        robot = place.study.robot.partition(":")[2] or ("turtlebot2" if place.study.robot == "simulated" else "")
        try:
            with open_record(results.database_url) as engine:
                median_s, episodes = trial_duration_s(engine, robot or place.study.robot)
        except RecordError:
            return f"{trials} trials; without a record their duration is unknown: give --seconds 180, or run a few"
        if not episodes:
            return f"{trials} trials; the record has no episodes of this robot: give their duration, --seconds 180"
        seconds, source = median_s, f"median of {episodes} in the record"
    each = f"{seconds:.3g}" if seconds < 100 else f"{seconds:.0f}"
    return f"{trials} trials at {each} s ({source}): {duration_text(trials * seconds)} in total"
