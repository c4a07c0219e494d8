"""What progress saves against success alone, from the record's own episodes of the study's site and goals."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.measures import COUNT, NUMBER, TEXT, Form, Measure, Measures, an_object, decimals, percents
from vsnbench.report.table import ReportTable
from vsnbench.study.file import StudyFile
from vsnbench.study.looks import looks_of
from vsnbench.study.power import decided_studies, looked_studies, pairs_of, unit_differences

if TYPE_CHECKING:
    import pandas as pd

Floats = npt.NDArray[np.float64]
SAMPLES = 600
MAX_PAIRS = 3
MIN_STARTS = 5
"""Fewest shared starting positions of a pair."""


@dataclass(frozen=True, slots=True)
class MetricCost:
    """What a study on one metric costs if the recorded difference of a pair is the true one."""

    metric: str
    difference: float
    """Mean over the shared cells, first minus second."""
    found: float | None
    """Share of simulated studies that name the better model; None for a whole plan."""
    blocks: float
    """Mean number of blocks run; for a whole plan the blocks needed for the plan's power, infinite without a
    difference."""


@dataclass(frozen=True, slots=True)
class PilotPair:
    """Two recorded conditions in the study's site."""

    first: str
    second: str
    cells: int
    success: MetricCost
    progress: MetricCost

    @property
    def saved(self) -> float:
        """Blocks that progress saves; negative if it needs more, NaN if neither ends."""
        return self.success.blocks - self.progress.blocks


def pilot_pairs(record: ReportData, study: StudyFile, site_sha256: str, starts: int) -> tuple[PilotPair, ...]:
    """Return the pairs of recorded models that share cells of the study; arms first, then those with more cells.

    Args:
        record: episodes of the record.
        study: the plan.
        site_sha256: hash of the study's site.
        starts: number of starting positions of the study.
    """
    here = [c for c in record.conditions if c.site_sha256 == site_sha256 and not c.not_competing and not c.published]
    arms = {arm.model for arm in study.arms.values()}
    found = []
    for first, second in combinations(here, 2):
        cells = _shared_cells(record.counted(first), record.counted(second), study.goals)
        if len(cells) >= MIN_STARTS:
            rank = (-len({first.model, second.model} & arms), -len(cells) * len(cells[0]))
            found.append((rank, first.name, second.name, cells))
    found.sort(key=lambda pair: pair[0])
    return tuple(
        PilotPair(first, second, len(cells) * len(cells[0]), *_costs(study, cells, starts))
        for _, first, second, cells in found[:MAX_PAIRS]
    )


_Cell = tuple[Floats, Floats]
"""(episodes, 2) success and progress of the first and of the second model."""


def _shared_cells(first: "pd.DataFrame", second: "pd.DataFrame", goals: Sequence[str]) -> list[list[_Cell]]:
    """Return the cells by starting position, for the positions where both models have every shared goal."""
    sides = [_by_cell(rows) for rows in (first, second)]
    both = sides[0].keys() & sides[1].keys()
    common = [goal for goal in goals if any(goal == known for known, _ in both)]
    if not common:
        return []
    starts = sorted({start for _, start in both if start > 0 and all((goal, start) in both for goal in common)})
    return [[(sides[0][goal, start], sides[1][goal, start]) for goal in common] for start in starts]


def _by_cell(rows: "pd.DataFrame") -> dict[tuple[str, int], Floats]:
    known = rows[rows["progress"].notna()].astype({"goal": str})
    return {
        (str(goal), int(str(start))): cell[["success", "progress"]].to_numpy(np.float64)
        for (goal, start), cell in known.groupby(["goal", "start"])
    }


def _costs(study: StudyFile, cells: list[list[_Cell]], starts: int) -> Iterator[MetricCost]:
    arms = _resampled(study, cells, starts) if study.stopping == "decided" else None
    for column, metric in enumerate(("success", "progress")):
        by_start = np.array(
            [np.mean([one[:, column].mean() - other[:, column].mean() for one, other in goals]) for goals in cells]
        )
        difference = float(by_start.mean())
        if arms is None:
            blocks = _needed_starts(study, by_start) * len(study.goals) * study.repetitions
            yield MetricCost(metric, difference, None, blocks)
            continue
        if study.by_looks:
            looked = looked_studies(study, arms[..., column].mean(-1), study.repetitions, looks_of(study, starts))
            right = looked.signs > 0 if study.of_margin else looked.signs == np.sign(difference)
            per_start = arms.shape[3] * arms.shape[4]
            yield MetricCost(metric, difference, float(right.mean()), float(looked.units.mean()) * per_start)
            continue
        of_starts = study.by_starting_position
        units = unit_differences(arms[..., column], by_start=of_starts)
        units = np.random.default_rng(1).permuted(units, axis=1)
        level = study.alpha / pairs_of(study)
        ended = decided_studies(units, level, study.margin, by_start=of_starts, of_progress=metric == "progress")
        blocks = float(ended.units.mean()) * (arms.shape[3] * arms.shape[4] if of_starts else 1)
        yield MetricCost(metric, difference, float((ended.signs == np.sign(difference)).mean()), blocks)


def _resampled(study: StudyFile, cells: list[list[_Cell]], starts: int) -> Floats:
    """Return (2, samples, starts, goals, repetitions, metrics) values: positions and episodes drawn from the record."""
    random = np.random.default_rng(0)
    shape = (2, SAMPLES, starts, len(cells[0]), study.repetitions, 2)
    drawn, places = np.empty(shape), random.integers(0, len(cells), (SAMPLES, starts))
    for place, goals in enumerate(cells):
        sample, position = np.nonzero(places == place)
        for goal, pair in enumerate(goals):
            for arm, episodes in enumerate(pair):
                chosen = random.integers(0, len(episodes), (len(sample), study.repetitions))
                drawn[arm, sample, position, goal] = episodes[chosen]
    return drawn


def _needed_starts(study: StudyFile, by_start: Floats) -> float:
    """Return the starting positions for the plan's power, by the normal approximation for paired means."""
    effect, spread = abs(float(by_start.mean())) - study.margin, float(by_start.std(ddof=1))
    if effect <= 0:
        return math.inf
    normal = NormalDist()
    reach = normal.inv_cdf(1 - study.alpha / pairs_of(study) / 2) + normal.inv_cdf(study.power)
    return max(2.0, math.ceil((reach * spread / effect) ** 2))


_SHARE = "share of simulated studies that name the better model"
_COST = Measures(
    Measure("metric", TEXT, "`success` or `progress`"),
    Measure("difference", Form({"type": "number"}), "mean over the shared cells, first minus second"),
    Measure("found", NUMBER, _SHARE, null="for `stopping: plan`"),
    Measure("blocks", NUMBER, "mean number of blocks", null="if no number suffices"),
)
PILOT = Measures(
    Measure("first", TEXT, "name of the first condition"),
    Measure("second", TEXT, "name of the second condition"),
    Measure("cells", COUNT, "number of shared cells"),
    Measure("success", an_object(_COST), "a study on success alone"),
    Measure("progress", an_object(_COST), "a study on progress"),
    Measure("saved", NUMBER, "blocks that progress saves"),
)
"""The JSON object of a `PilotPair`."""


def pilot_table(pairs: Sequence[PilotPair], study: StudyFile) -> ReportTable:
    """Return the table of what success and progress cost."""
    decided = study.stopping == "decided"
    needed = "blocks run" if decided else f"blocks for {study.power:.0%} power"
    measures = Measures(
        Measure("", TEXT, of=lambda row: f"{row[0].first} – {row[0].second}", heading="recorded models"),
        Measure("", COUNT, "shared cells of the study's goals", lambda row: row[0].cells, heading="cells"),
        Measure("", TEXT, of=lambda row: row[1].metric, heading="metric"),
        Measure("", percents(1), of=lambda row: row[1].difference, heading="difference %"),
        *([Measure("", percents(0), of=lambda row: row[1].found, heading="finds the better %")] if decided else []),
        Measure(
            "",
            decimals(0),
            "a block is every arm once on one cell and repetition",
            lambda row: row[1].blocks,
            heading=needed,
        ),
        Measure(
            "",
            decimals(0),
            "against success alone; negative if progress needs more",
            _saved,
            heading="blocks saved",
        ),
    )
    rows = [(pair, cost) for pair in pairs for cost in (pair.success, pair.progress)]
    how = (
        f"{SAMPLES} studies of this design, with starting positions and episodes drawn from the record."
        if decided
        else "Normal approximation for the mean difference of starting positions."
    )
    notes = (how, "The recorded difference is taken as the true one, which is optimistic for both metrics.")
    return measures.table("pilot", "Success and progress on the record's own episodes", rows, notes=notes)


def _saved(row: tuple[PilotPair, MetricCost]) -> float:
    pair, cost = row
    return pair.saved if cost is pair.progress else math.nan
