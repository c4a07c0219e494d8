"""Chooses the figures of a report and draws them."""

import multiprocessing
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from vsnbench.database.migrate import open_record
from vsnbench.errors import SiteError
from vsnbench.protocol.site import Site
from vsnbench.report.build import Report, build
from vsnbench.report.conditions import Condition
from vsnbench.report.figures.actions import action_histogram
from vsnbench.report.figures.courses import mileage, survival
from vsnbench.report.figures.plans import success_map, trajectory_plan
from vsnbench.report.figures.rates import success_by_goal
from vsnbench.report.figures.style import Drawing
from vsnbench.report.published import published_results
from vsnbench.report.record import Selection
from vsnbench.report.summary import ConditionSummary
from vsnbench.report.trajectories import Track, read_tracks
from vsnbench.workers import end_with_parent

MOST_PLANS = 3
"""Conditions whose floor plans are drawn; a report on fewer models draws the others'."""

PLANS_BESIDE = 2
"""Of these conditions a second process draws the plans: they take about as long as all that is left for the first."""


def drawings(report: Report, url: str) -> Iterator[Drawing]:
    """Draw the figures of a report, in the order in which they are looked at.

    Args:
        report: with its activity.
        url: of the database, where the trajectories are read.
    """
    charts = _charts(report)
    yield next(charts)
    yield from _histograms(report)
    yield from charts
    for plan in _plans(report, url):
        yield from plan.drawings()


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
    shared = PLANS_BESIDE if can_fork else 0  # matplotlib draws in one thread at a time
    with _beside(can_fork=can_fork) as beside:
        plans: list[_Plans] = []
        waiting: list[Future[list[Drawing]]] = []
        charts: list[Drawing] = []

        def draw_what_needs_no_counts(uncounted: Report) -> None:
            plans.extend(_plans(uncounted, url))
            waiting.extend(beside.submit(plan.finished) for plan in plans[:shared])
            charts.extend(chart.finish() for chart in _charts(uncounted))

        report = build(
            *(url, selection, results_directory),
            reference=reference,
            meanwhile=draw_what_needs_no_counts,
            beside=beside,
        )
        histograms = [histogram.finish() for histogram in _histograms(report)]
        own = [drawing for plan in plans[shared:] for drawing in plan.finished()]
        drawn_beside = [drawing for each in waiting for drawing in each.result()]
    first, *others = charts
    return report, [first, *histograms, *others, *drawn_beside, *own]


def _beside(*, can_fork: bool) -> Executor:
    if can_fork:
        # Forked, not spawned: importing everything again would take longer than what is gained. No thread runs yet.
        return ProcessPoolExecutor(1, multiprocessing.get_context("fork"), end_with_parent)
    return ThreadPoolExecutor(1)


def _charts(report: Report) -> Iterator[Drawing]:
    """Draw what needs no counted actions, success by goal first."""
    record, results = report.record, report.results
    yield success_by_goal(results, published_results() if report.reference else None)
    yield from (course for course in (survival(record, results), mileage(record)) if course)


def _histograms(report: Report) -> Iterator[Drawing]:
    if report.activity and (histogram := action_histogram(report.results, report.activity.actions)):
        yield histogram


@dataclass(frozen=True, slots=True)
class _Plans:
    """What the floor plans of one condition are drawn from."""

    site: Site
    summary: ConditionSummary
    tracks: tuple[Track, ...]

    def drawings(self) -> list[Drawing]:
        """Draw them: the trajectories, then the success by starting position."""
        drawn = (trajectory_plan(self.site, self.summary, self.tracks), success_map(self.site, self.summary))
        return [drawing for drawing in drawn if drawing is not None]

    def finished(self) -> list[Drawing]:
        """Draw and save them."""
        return [drawing.finish() for drawing in self.drawings()]


def _plans(report: Report, url: str) -> Iterator[_Plans]:
    engine = open_record(url)
    try:
        for one in report.results.conditions[:MOST_PLANS]:
            site = _site(report, one.condition)
            if site is not None:
                yield _Plans(site, one, read_tracks(engine, report.record, one.condition))
    finally:
        engine.dispose()


def _site(report: Report, condition: Condition) -> Site | None:
    """Return the site as it was recorded; None where an import brought none that can be drawn."""
    content = report.record.sites.get(condition.site_sha256)
    if not content:
        return None
    try:
        return Site.model_validate(content)
    except (ValueError, SiteError):
        return None
