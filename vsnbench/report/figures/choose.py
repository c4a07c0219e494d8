"""Selects the figures of a report and draws them."""

import gc
import multiprocessing
import pickle
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from vsnbench.errors import VsnbenchError
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.courses import site_of
from vsnbench.report.analysis.published import published_results
from vsnbench.report.analysis.summary import ConditionSummary
from vsnbench.report.build import Report, build
from vsnbench.report.figures.actions import action_histogram
from vsnbench.report.figures.cells import success_by_cell
from vsnbench.report.figures.cumulative import mileage, outcomes_over_actions
from vsnbench.report.figures.differences import differences
from vsnbench.report.figures.failure_map import failure_maps
from vsnbench.report.figures.plans import read_tracks, success_maps, trajectory_plan
from vsnbench.report.figures.rates import success_by_goal
from vsnbench.report.figures.stages import stage_bars
from vsnbench.report.figures.style import FORMATS, Drawing
from vsnbench.results.schema.migrate import open_record
from vsnbench.runtime.child_process import end_with_parent
from vsnbench.sites.site import Site

MAX_TRAJECTORIES = 12
"""Maximum number of conditions whose trajectories are drawn; other figures use as many pages as needed."""

MAX_BY_START = 4
"""Maximum number of conditions of a report whose trajectories may have a plan per start, which take long to draw."""

WORKER_TRAJECTORIES = 2
"""Number of trajectory figures, and every other one after them, that the worker process draws."""

_ALLOCATIONS = 20_000
"""Allocations between garbage collections; each collection traverses all figures."""

_Plan = Callable[[], Drawing | None]
"""Draws the trajectories of a condition; it has the data, so that another process can call it. None without tracks."""
_ORDER = (
    "differences",
    "success-by-goal",
    "success-by-cell",
    "stages",
    "outcomes-over-actions",
    "success-map",
    "failure-map",
    "trajectories",
    "actions",
    "mileage",
)
"""Order of the figures, by the beginning of their names."""


def drawings(report: Report, url: str) -> list[Drawing]:
    """Draw the figures of a report in reading order."""
    drawn = [*_charts(report), *_histograms(report)]
    return _in_order([*drawn, *(drawing for plan in _plans(report, url) if (drawing := plan()))])


def _in_order(drawn: Iterable[Drawing]) -> list[Drawing]:
    return sorted(drawn, key=lambda drawing: next(n for n, name in enumerate(_ORDER) if drawing.name.startswith(name)))


def build_and_draw(
    url: str,
    selection: Selection,
    results_directory: Path | None = None,
    *,
    reference: bool = False,
    only: Sequence[str] = (),
    formats: Sequence[str] = FORMATS,
) -> tuple[Report, list[Drawing]]:
    """Build a report and draw its figures, with a second process.

    The worker process counts actions while this one draws charts, then both draw floor plans. Saving takes longest.

    Args:
        url: database URL of the record.
        selection: what of the record is reported.
        results_directory: where the record's files are.
        reference: include the published results.
        only: names of the figures to save; without any, all. The others have no content.
        formats: in which they are saved.

    Raises:
        RecordError: no record exists, it is empty or it cannot be read.
        UsageError: nothing in the record matches the selection.
        VsnbenchError: the second process was killed.
    """
    save = partial(_saved, only=only, formats=formats)
    can_fork = "fork" in multiprocessing.get_all_start_methods()
    with _few_collections(), _worker(can_fork=can_fork) as worker:
        plans: list[_Plan] = []
        waiting: dict[int, Future[Drawing | None]] = {}
        drawn: list[Drawing] = []

        def draw_charts(uncounted: Report) -> None:
            plans.extend(_plans(uncounted, url))
            if can_fork:  # otherwise the worker is a thread, and matplotlib is not thread-safe
                places = range(len(plans))
                in_worker = (*places[:WORKER_TRAJECTORIES], *places[WORKER_TRAJECTORIES + 1 :: 2])
                for place in in_worker:  # encoded now: the executor does it later, while this thread computes groups
                    waiting[place] = worker.submit(_finished_encoded, pickle.dumps((plans[place], save)))
            drawn.extend(save(chart) for chart in _charts(uncounted))

        report = build(url, selection, results_directory, reference=reference, meanwhile=draw_charts, executor=worker)
        drawn += [save(histogram) for histogram in _histograms(report)]
        here = {place: _finished(plan, save) for place, plan in enumerate(plans) if place not in waiting}
        trajectories = [waiting[place].result() if place in waiting else here[place] for place in range(len(plans))]
    return report, _in_order([*drawn, *(drawing for drawing in trajectories if drawing)])


def _finished(plan: _Plan, save: Callable[[Drawing], Drawing]) -> Drawing | None:
    """Draw and save a figure; None without tracks."""
    drawing = plan()
    return save(drawing) if drawing else None


def _finished_encoded(plan_and_save: bytes) -> Drawing | None:
    """Draw and save a figure in another process of this command."""
    return _finished(*pickle.loads(plan_and_save))  # noqa: S301 - `build_and_draw` encoded it


def _saved(drawing: Drawing, only: Sequence[str], formats: Sequence[str]) -> Drawing:
    return drawing.finish(formats if not only or drawing.name in only else ())


@contextmanager
def _few_collections() -> Iterator[None]:
    """Collect garbage a tenth as often, also in the worker: figures are full of reference cycles."""
    before = gc.get_threshold()
    gc.set_threshold(_ALLOCATIONS, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


@contextmanager
def _worker(*, can_fork: bool) -> Iterator[Executor]:
    if not can_fork:
        with ThreadPoolExecutor(1) as thread:
            yield thread
        return
    try:
        # Fork instead of spawn, because importing everything again would cancel the gain. No thread is running yet.
        with ProcessPoolExecutor(1, multiprocessing.get_context("fork"), end_with_parent) as process:
            yield process
    except BrokenProcessPool as error:
        raise VsnbenchError(
            "the process that draws figures was killed",
            advice="if memory is short, end other programs; then run the command again",
            code="drawing-killed",
        ) from error


def _charts(report: Report) -> Iterator[Drawing]:
    """Draw the figures that need no action counts."""
    record, results = report.record, report.results
    yield from differences(report.questions)
    yield from success_by_goal(results, published_results() if report.reference else None)
    yield from success_by_cell(results)
    yield from outcomes_over_actions(record, results)
    yield from success_maps(_placed(report))
    if course := mileage(record):
        yield course


def _histograms(report: Report) -> Iterator[Drawing]:
    if report.activity:
        placed = {summary.condition.number: (site, summary) for site, summary in _placed(report)}
        yield from action_histogram(report.results, report.activity.actions)
        yield from stage_bars(report.results, report.activity.courses)
        yield from failure_maps(
            (*placed[failures["condition"]], failures["places"])
            for failures in report.activity.failures
            if failures["condition"] in placed
        )


def _plans(report: Report, url: str) -> Iterator[_Plan]:
    """Yield the trajectory figure of each condition with the data that it needs, to be drawn by a call."""
    placed = _placed(report)
    left_out = ""
    if others := [summary.condition.name for _, summary in placed[MAX_TRAJECTORIES:]]:
        left_out = (
            f" Drawn for {MAX_TRAJECTORIES} of {len(placed)} conditions; not drawn: {', '.join(others)} "
            "(use `vsnbench report --model NAME --output DIR`)."
        )
    with open_record(url) as engine:
        for site, summary in placed[:MAX_TRAJECTORIES]:
            tracks = read_tracks(engine, report.record, summary.condition)
            may_split = len(placed) <= MAX_BY_START
            yield partial(trajectory_plan, site, summary, tracks, left_out, may_split=may_split)


def _placed(report: Report) -> list[tuple[Site, ConditionSummary]]:
    """Return the conditions whose site is known."""
    conditions = report.results.conditions
    return [(site, summary) for summary in conditions if (site := site_of(report.record, summary.condition))]
