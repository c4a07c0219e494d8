"""Chooses the figures of a report and draws them."""

import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

from sqlalchemy import Engine

from vsnbench.database.migrate import open_record
from vsnbench.errors import SiteError
from vsnbench.protocol.site import Site
from vsnbench.report.build import Report
from vsnbench.report.figures.actions import action_histogram
from vsnbench.report.figures.courses import mileage, survival
from vsnbench.report.figures.plans import success_map, trajectory_plan
from vsnbench.report.figures.rates import success_by_goal
from vsnbench.report.figures.style import Drawing
from vsnbench.report.published import published_results
from vsnbench.report.record import Condition
from vsnbench.report.summary import ConditionSummary
from vsnbench.report.trajectories import Track, read_tracks

MOST_PLANS = 3
"""Conditions whose floor plans are drawn; a report on fewer models draws the others'."""

PLANS_BESIDE = 2
"""Of these conditions a second process draws the plans: they take about as long as all that is left for the first."""


def drawings(report: Report, engine: Engine) -> Iterator[Drawing]:
    """Draw the figures of a report, in the order in which they are looked at.

    Args:
        report: with its activity.
        engine: where the trajectories are read.
    """
    yield from _charts(report)
    for plan in _plans(report, engine):
        yield from plan.drawings()


def finished_drawings(report: Report, url: str) -> list[Drawing]:
    """Draw the same figures and save them in every form: charts here, floor plans in a process beside.

    Args:
        report: with its activity.
        url: of the database, where the trajectories are read.

    Raises:
        RecordError: the database cannot be used.
    """
    engine = open_record(url)
    try:
        plans = list(_plans(report, engine))
    finally:
        engine.dispose()
    if "fork" not in multiprocessing.get_all_start_methods():
        return [
            drawing.finish() for drawing in (*_charts(report), *(each for plan in plans for each in plan.drawings()))
        ]
    # Forked, not spawned: importing everything again would take longer than the drawing. No thread runs by now.
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as beside:
        waiting = [beside.submit(plan.finished) for plan in plans[:PLANS_BESIDE]]
        charts = [drawing.finish() for drawing in _charts(report)]
        own = [drawing for plan in plans[PLANS_BESIDE:] for drawing in plan.finished()]
        return [*charts, *(drawing for each in waiting for drawing in each.result()), *own]


def _charts(report: Report) -> Iterator[Drawing]:
    record, results = report.record, report.results
    yield success_by_goal(results, published_results() if report.reference else None)
    if report.activity and (histogram := action_histogram(results, report.activity.actions)):
        yield histogram
    if course := survival(record, results):
        yield course
    if course := mileage(record):
        yield course


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


def _plans(report: Report, engine: Engine) -> Iterator[_Plans]:
    for one in report.results.conditions[:MOST_PLANS]:
        site = _site(report, one.condition)
        if site is not None:
            yield _Plans(site, one, read_tracks(engine, report.record, one.condition))


def _site(report: Report, condition: Condition) -> Site | None:
    """Return the site as it was recorded; None where an import brought none that can be drawn."""
    content = report.record.sites.get(condition.site_sha256)
    if not content:
        return None
    try:
        return Site.model_validate(content)
    except (ValueError, SiteError):
        return None
