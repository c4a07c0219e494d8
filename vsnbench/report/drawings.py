"""Chooses the figures of a report and draws them."""

import gc
import multiprocessing
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from vsnbench.database.migrate import open_record
from vsnbench.errors import SiteError
from vsnbench.protocol.site import Site
from vsnbench.report.build import Report, build
from vsnbench.report.conditions import Condition
from vsnbench.report.figures.actions import action_histogram
from vsnbench.report.figures.cells import success_by_cell
from vsnbench.report.figures.courses import mileage, outcomes_over_actions
from vsnbench.report.figures.differences import differences
from vsnbench.report.figures.plans import success_maps, trajectory_plan
from vsnbench.report.figures.rates import success_by_goal
from vsnbench.report.figures.style import Drawing
from vsnbench.report.published import published_results
from vsnbench.report.record import Selection
from vsnbench.report.summary import ConditionSummary
from vsnbench.report.trajectories import Track, read_tracks
from vsnbench.workers import end_with_parent

MOST_TRAJECTORIES = 12
"""Conditions whose trajectories are drawn; every other figure goes on over as many pages as it needs."""

TRAJECTORIES_BESIDE = 2
"""Of these conditions, and of every other one after them, a second process draws the trajectories: the first ones take
about as long as all that is left."""

_ALLOCATIONS = 20_000
"""After so many new objects more than freed ones garbage is looked for: every time it costs a walk over all figures."""

_ORDER = (
    "differences",
    "success-by-goal",
    "success-by-cell",
    "outcomes-over-actions",
    "success-map",
    "trajectories",
    "actions",
    "mileage",
)
"""Figures in the order in which they are looked at, by the beginning of their names."""


def drawings(report: Report, url: str) -> list[Drawing]:
    """Draw the figures of a report, in the order in which they are looked at.

    Args:
        report: with its activity.
        url: of the database, where the trajectories are read.
    """
    drawn = [*_charts(report), *_histograms(report)]
    return _in_order([*drawn, *(one for plan in _plans(report, url) if (one := plan.drawing()))])


def _in_order(drawn: Iterable[Drawing]) -> list[Drawing]:
    return sorted(drawn, key=lambda each: next(n for n, name in enumerate(_ORDER) if each.name.startswith(name)))


def build_and_draw(
    url: str, selection: Selection, results_directory: Path | None = None, *, reference: bool = False
) -> tuple[Report, list[Drawing]]:
    """Build a report and draw the same figures, saved in every form; both cores are kept busy.

    A process beside counts the actions while charts are drawn here, then draws floor plans.

    Args:
        url: any SQLAlchemy URL.
        selection: which part of the record.
        results_directory: where the images of its episodes lie.
        reference: lay the paper's numbers beside.

    Raises:
        RecordError: there is no record, nothing in it, or it cannot be read.
        UsageError: the selection fits nothing in it.
    """
    can_fork = "fork" in multiprocessing.get_all_start_methods()
    shared = TRAJECTORIES_BESIDE if can_fork else 0  # matplotlib draws in one thread at a time
    with _few_collections(), _beside(can_fork=can_fork) as beside:
        plans: list[_Plan] = []
        waiting: dict[int, Future[Drawing | None]] = {}
        drawn: list[Drawing] = []

        def draw_what_needs_no_counts(uncounted: Report) -> None:
            plans.extend(_plans(uncounted, url))
            waiting.update(
                {plan.summary.condition.number: beside.submit(plan.finished) for plan in _drawn_beside(plans, shared)}
            )
            drawn.extend(chart.finish() for chart in _charts(uncounted))

        report = build(
            *(url, selection, results_directory),
            reference=reference,
            meanwhile=draw_what_needs_no_counts,
            beside=beside,
        )
        drawn += [histogram.finish() for histogram in _histograms(report)]
        numbers = [plan.summary.condition.number for plan in plans]
        here = {n: plan.finished() for n, plan in zip(numbers, plans, strict=True) if n not in waiting}
        trajectories = [here[n] if n in here else waiting[n].result() for n in numbers]
    return report, _in_order([*drawn, *(each for each in trajectories if each)])


def _drawn_beside(plans: "Sequence[_Plan]", shared: int) -> "Sequence[_Plan]":
    return [*plans[:shared], *plans[shared + 1 :: 2]] if shared else ()


@contextmanager
def _few_collections() -> Iterator[None]:
    """Look for garbage a tenth as often, in the process beside too: figures are made of cycles, and few at a time."""
    before = gc.get_threshold()
    gc.set_threshold(_ALLOCATIONS, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


def _beside(*, can_fork: bool) -> Executor:
    if can_fork:
        # Forked, not spawned: importing everything again would take longer than what is gained. No thread runs yet.
        return ProcessPoolExecutor(1, multiprocessing.get_context("fork"), end_with_parent)
    return ThreadPoolExecutor(1)


def _charts(report: Report) -> Iterator[Drawing]:
    """Draw what needs no counted actions."""
    record, results = report.record, report.results
    yield from differences(report.questions)
    yield from success_by_goal(results, published_results() if report.reference else None)
    yield from success_by_cell(results)
    yield from outcomes_over_actions(record, results)
    yield from success_maps(
        [(site, one) for one in results.conditions if (site := _site(report, one.condition)) is not None]
    )
    if course := mileage(record):
        yield course


def _histograms(report: Report) -> Iterator[Drawing]:
    if report.activity:
        yield from action_histogram(report.results, report.activity.actions)


@dataclass(frozen=True, slots=True, eq=False)
class _Plan:
    """What the trajectories of one condition are drawn from."""

    site: Site
    summary: ConditionSummary
    tracks: tuple[Track, ...]
    left_out: str
    """What to say of the conditions that are not drawn; empty for none."""

    def drawing(self) -> Drawing | None:
        """Draw it; None when no track is known."""
        return trajectory_plan(self.site, self.summary, self.tracks, self.left_out)

    def finished(self) -> Drawing | None:
        """Draw and save it."""
        drawing = self.drawing()
        return drawing.finish() if drawing else None


def _plans(report: Report, url: str) -> Iterator[_Plan]:
    placed = [(site, one) for one in report.results.conditions if (site := _site(report, one.condition)) is not None]
    left_out = ""
    if others := [one.condition.name for _, one in placed[MOST_TRAJECTORIES:]]:
        left_out = (
            f" Drawn for {MOST_TRAJECTORIES} of {len(placed)} conditions, not for {', '.join(others)}: "
            "`vsnbench report --model NAME --output DIR` draws those of one model."
        )
    with open_record(url) as engine:
        for site, one in placed[:MOST_TRAJECTORIES]:
            yield _Plan(site, one, read_tracks(engine, report.record, one.condition), left_out)


def _site(report: Report, condition: Condition) -> Site | None:
    """Return the site as it was recorded; None where an import brought none that can be drawn."""
    content = report.record.sites.get(condition.site_sha256)
    if not content:
        return None
    try:
        return Site.model_validate(content)
    except (ValueError, SiteError):
        return None
