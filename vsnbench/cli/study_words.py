"""What is said of a study before it runs: its arms in a line each, and what an operator could see through."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vsnbench.database.study_entries import LockedArm
    from vsnbench.runner.study_arms import StudyPlace


def arm_lines(arms: "Sequence[LockedArm]") -> Iterator[str]:
    """Yield a line an arm: its model, weights and trials."""
    widest = max(len(arm.name) for arm in arms)
    for arm in arms:
        model = arm.plan.model
        weights = f", {model.weights_label or 'weights'} ({model.weights_sha256[:12]})" if model.weights_sha256 else ""
        bound = "; is handed the site: an upper bound, no competitor" if model.surveyed else ""
        yield f"{arm.name:<{widest}}  {model.name}{weights}: {len(arm.plan.trials)} trials{bound}"


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
