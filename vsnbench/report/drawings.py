"""Chooses the figures of a report and draws them."""

from collections.abc import Iterator

from sqlalchemy import Engine

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
from vsnbench.report.trajectories import read_tracks

MOST_PLANS = 3
"""Conditions whose floor plans are drawn; a report on fewer models draws the others'."""


def drawings(report: Report, engine: Engine) -> Iterator[Drawing]:
    """Draw the figures of a report, in the order in which they are looked at.

    Args:
        report: with its activity.
        engine: where the trajectories are read.
    """
    record, results = report.record, report.results
    yield success_by_goal(results, published_results() if report.reference else None)
    if report.activity and (histogram := action_histogram(results, report.activity.actions)):
        yield histogram
    if course := survival(record, results):
        yield course
    if course := mileage(record):
        yield course
    for one in results.conditions[:MOST_PLANS]:
        site = _site(report, one.condition)
        if site is None:
            continue
        if plan := trajectory_plan(site, one, read_tracks(engine, record, one.condition)):
            yield plan
        if plan := success_map(site, one):
            yield plan


def _site(report: Report, condition: Condition) -> Site | None:
    """Return the site as it was recorded; None where an import brought none that can be drawn."""
    content = report.record.sites.get(condition.site_sha256)
    if not content:
        return None
    try:
        return Site.model_validate(content)
    except (ValueError, SiteError):
        return None
