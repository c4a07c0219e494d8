"""Primary rate of a study with a planned twin: prediction-powered by simulated trials that were run before."""

from collections.abc import Collection, Mapping

from vsnbench.statistics.clustered import Cell
from vsnbench.statistics.prediction_powered import OnlyPredicted, Powered, PredictedCell, powered
from vsnbench.study.file import StudyFile

Places = Mapping[tuple[str, int], float]
"""Simulated success rate by goal and starting position."""


def powered_by_twin(
    study: StudyFile, run: Mapping[tuple[str, int], Cell], planned: Collection[tuple[str, int]], twin: Places
) -> Powered | None:
    """Return the estimate with a planned twin; None without one, or if it lacks a cell that was run.

    Args:
        study: the plan.
        run: the cells with real trials.
        planned: all cells that were drawn for real trials.
        twin: the twin's rates in all cells.
    """
    if study.real_cells is None or not run.keys() <= twin.keys():
        return None
    driven = [PredictedCell(cell, twin[place]) for place, cell in sorted(run.items())]
    others = [
        OnlyPredicted(start, rate)
        for (goal, start), rate in sorted(twin.items())
        if goal in study.goals and (goal, start) not in planned
    ]
    return powered(driven, others, 1 - study.alpha)


def twin_words(estimate: Powered | None, twin: Places) -> str:
    """Return what a planned twin added, for the name of the method."""
    if estimate is None:
        why = "covers too few cells" if twin else "has no results in these cells from before the first real trial"
        return f"; without the planned twin, which {why}"
    return (
        "; prediction-powered by the planned twin (PPI++, clustered by starting position), which has the weight "
        f"{estimate.tuning:.2f} and saves an estimated {estimate.saved:.1f} real cells beside the {estimate.cells} "
        "that were run"
    )
