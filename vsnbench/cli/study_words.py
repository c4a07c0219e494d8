"""What is said of a study before it runs: its arms in a line each, and what an operator could see through."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from vsnbench.harmless_text import counted

if TYPE_CHECKING:
    from vsnbench.database.study_entries import LockedArm
    from vsnbench.record.results import ResultsDirectory
    from vsnbench.report.sheets import Sheet
    from vsnbench.runner.study_arms import StudyPlace


def arm_lines(arms: "Sequence[LockedArm]") -> Iterator[str]:
    """Yield a line an arm: its model, weights and trials."""
    widest = max(len(arm.name) for arm in arms)
    for arm in arms:
        model = arm.plan.model
        weights = f", {model.weights_label or 'weights'} ({model.weights_sha256[:12]})" if model.weights_sha256 else ""
        bound = "; is handed the site: an upper bound, no competitor" if model.surveyed else ""
        yield f"{arm.name:<{widest}}  {model.name}{weights}: {len(arm.plan.trials)} trials{bound}"


def arm_fields(arms: "Sequence[LockedArm]") -> list[dict[str, object]]:
    """Return the same for scripts."""
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


def warnings_of(place: "StudyPlace") -> Iterator[str]:
    """Yield what an operator could tell the arms by, and what the design cannot do."""
    import re

    study = place.study
    if study.blind:
        names = {name.lower() for name in study.arms} | {arm.model.lower() for arm in study.arms.values()}
        for field in ("title", "question", "notes"):
            found = set(re.findall(r"[a-z0-9_.-]+", getattr(study, field).lower())) & names
            if found:
                yield f"{field} names {', '.join(sorted(found))}, and operators see it while the study is blind"
        if any(arm.goals for arm in study.arms.values()):
            yield "arms with goals of their own can be told apart by them while the study is blind"
    if study.order == "as-planned":
        yield "as-planned runs arm after arm: what drifts with time (battery, light, floor) looks like a difference"
    if study.stopping == "decided" and study.of_these_cells:
        yield "stopping: decided speaks of these cells alone; about: cells-like-these speaks of others too"


def power_sheet(place: "StudyPlace", rate: float) -> "Sheet":
    """Return what the design makes of true differences."""
    from vsnbench.report.sheets import Column, Sheet, decimal, percent, row
    from vsnbench.statistics.power import fewest_starts
    from vsnbench.study.power import DIFFERENCES, design_of_study, pairs_of, planned_power

    study = place.study
    starts = len({one.start for one in place.schedule.trials})
    design = design_of_study(study, starts, rate)
    wanted = tuple(sorted({*DIFFERENCES, study.difference}))
    found = planned_power(study, design, wanted)
    goals, again = counted(len(study.goals), "goal"), counted(study.repetitions, "repetition")
    size = f"{counted(starts, 'starting position')}, {goals}, {again}"
    level = f"alpha {study.alpha:g} over {counted(pairs_of(study), 'question')}"
    alike = "how hard cells are differs (correlation 0.3, 0.1 across a position's goals), half of it for both models"
    notes = [f"{size}; mean rate {rate:.0%}; {level}. Hundreds of simulated studies a line.", f"Assumed: {alike}."]
    if study.margin:
        notes.append(f"To be found, an arm must be better by more than the margin of {study.margin:.0%}.")
    least = next((one.difference for one in found if one.power >= study.power), None)
    at = next(one for one in found if one.difference == study.difference)
    if at.power < study.power:
        more = f": it takes {least:.0%}" if least else ""
        notes.append(
            f"The {study.difference:.0%} that the study wants to find, it finds in {at.power:.0%} of cases, and not in "
            f"{study.power:.0%}{more}. More positions, or repetitions, would help."
        )
    if study.stopping == "plan" and starts < (fewest := fewest_starts(design.level)):
        notes.append(
            f"With {starts} starting positions no outcome at all can be significant: the test flips the signs of whole "
            f"positions, and needs {fewest}."
        )
    columns = (Column("true difference %"), Column("power %"), Column("blocks run"))
    rows = tuple(row(percent(one.difference, 0), percent(one.power, 0), decimal(one.blocks, 0)) for one in found)
    return Sheet("power", "What this design can show", columns, rows, tuple(notes))


def pace_words(place: "StudyPlace", results: "ResultsDirectory", seconds: float | None) -> str:
    """Say how long the whole plan takes, by the record's own pace or the one given."""
    from vsnbench.database.migrate import open_record
    from vsnbench.database.study_queries import pace_s
    from vsnbench.errors import RecordError

    trials, source = len(place.schedule.trials), "as given"
    if seconds is None:
        robot = place.study.robot.partition(":")[2] or ("turtlebot2" if place.study.robot == "simulated" else "")
        try:
            with open_record(results.database_url) as engine:
                pace, known = pace_s(engine, robot or place.study.robot)
        except RecordError:
            return f"{trials} trials; no record tells how long one takes: --seconds 180, or run a few first"
        if not known:
            return f"{trials} trials; the record has none of this robot: --seconds 180 says how long one takes"
        seconds, source = pace, f"the median of {known} in the record"
    return f"{trials} trials at {seconds:.0f} s ({source}): {trials * seconds / 3600:.1f} hours, all of them"
