"""The report as one self-contained HTML page with sortable tables, figures and images."""

import base64
import hashlib
import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

from vsnbench import __version__
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.summary import ConditionSummary, Summary
from vsnbench.report.build import Report
from vsnbench.report.figures.frame_strips import frame_strip
from vsnbench.report.figures.style import COLUMN_IN, Drawing
from vsnbench.report.formats.terms import GLOSSARY
from vsnbench.report.tables.headline import headlines
from vsnbench.report.tables.report_table import (
    Cell,
    ReportTable,
    count,
    decimal,
    footnotes_of,
    goal_distance,
    word,
)
from vsnbench.report.wording import listed
from vsnbench.results.reading.read_model import COUNTED
from vsnbench.text.sanitize import sanitize

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

MAX_EPISODES = 1000
MAX_OPEN_PLANS = 2
MAX_FRAME_STRIPS = 250
"""Maximum number of frame strips, which limits the size of the page."""


@dataclass(frozen=True, slots=True)
class _Card:
    number: int
    title: str
    rate: str
    interval: str
    bar_label: str
    low: str
    width: str
    at: str
    words: str


@dataclass(frozen=True, slots=True)
class _CardGroup:
    """Cards of one kind."""

    kind: str
    heading: str
    cards: tuple[_Card, ...]


@dataclass(frozen=True, slots=True)
class _Section:
    """Tables in one collapsible section."""

    name: str
    title: str
    words: str
    tables: tuple[ReportTable, ...]


@dataclass(frozen=True, slots=True)
class _Figure:
    name: str
    title: str
    alt: str
    caption: str
    footnotes: tuple[str, ...]
    data: str
    wide: bool
    """The figure has a row of its own."""
    width_rem: str
    shape: str
    """Aspect ratio, so that the layout does not shift while the page loads."""
    folded: bool
    """The figure is collapsed."""


@dataclass(frozen=True, slots=True)
class _Episode:
    number: int
    cells: tuple[tuple[Cell, bool], ...]
    outcome: str
    strip: str
    frames: int
    alt: str


_EPISODE_COLUMNS = (
    ("episode", True),
    ("model", False),
    ("goal", False),
    ("start", True),
    ("repetition", True),
    ("result", False),
    ("actions", True),
    ("distance (m)", True),
    ("SPL", True),
    ("began (UTC)", False),
)


def html_page(
    report: Report, tables: Sequence[ReportTable], drawings: Sequence[Drawing], episodes_page: str = ""
) -> str:
    """Return the page as text.

    Args:
        report: the report.
        tables: its tables.
        drawings: its figures.
        episodes_page: address of a page with all episodes; without one, the page has a table of them.
    """
    template = page_environment().get_template("page.html.j2")
    script, style = page_part("page.js"), page_part("page.css")
    results = report.results
    episodes = [] if episodes_page else list(_episodes(report.record))
    total_episodes = len(report.record.episodes)
    lead = (
        f"All {total_episodes} episodes."
        if total_episodes <= len(episodes)
        else f"The first {len(episodes)} of {total_episodes} episodes."
    )
    if strips := sum(bool(episode.strip) for episode in episodes):
        few = f" of the first {strips} with images" if strips == MAX_FRAME_STRIPS else ""
        lead += f" Images: five frames from the first to the last{few}."
    if without := int((report.record.episodes["images_directory"] == "").sum()):
        lead += f" {without} episodes have no images."
    from markupsafe import Markup

    listed_here = {episode.number for episode in episodes}

    def address(episode: int) -> str:
        """Return the address of an episode; empty if no page shows it."""
        if episodes_page:
            return f"{episodes_page}#/episode/{episode}"
        return f"#episode-{episode}" if episode in listed_here else ""

    planned = sum(summary.total.planned for summary in results.conditions)
    return template.render(
        render_table=page_environment().get_template("table.html.j2").module.render_table,  # type: ignore[attr-defined]
        address=address,
        version=__version__,
        title="vsnbench report",
        lead=f"{results.episodes} of {planned} planned trials completed; "
        f"{len(results.conditions)} condition{'s' if len(results.conditions) > 1 else ''}.",
        script=Markup(script),  # noqa: S704 - our own files, not text from the record
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        style=Markup(style),  # noqa: S704
        questions=report.questions,
        card_groups=_card_groups(results.conditions),
        sections=_sections(results.conditions, tables),
        figures=_figures(drawings),
        episodes=episodes,
        episodes_lead=lead,
        episodes_page=episodes_page,
        episode_columns=_EPISODE_COLUMNS,
        viewing=_viewing(report.record, episodes),
        glossary=GLOSSARY,
        names=footnotes_of(tables),
        footer=f"Generated by vsnbench {__version__} from the record.",
    )


def _card_groups(conditions: Sequence[ConditionSummary]) -> list[_CardGroup]:
    """Separate the competitors, the upper bounds and the conditions with too few trials."""
    peers = [summary for summary in conditions if summary.is_competitor]
    bounds = [summary for summary in conditions if summary.condition.surveyed]
    few = [summary for summary in conditions if summary not in peers and summary not in bounds]
    shelves = (
        ("peers", f"Success rate over {headlines(peers).description}, 95 % interval", peers),
        ("few", "Too few trials to compare", few),
        ("bounds", "Upper bounds: models with access to the site file", bounds),
    )
    return [_CardGroup(kind, heading, _cards(members, conditions)) for kind, heading, members in shelves if members]


def _cards(members: Sequence[ConditionSummary], everyone: Sequence[ConditionSummary]) -> tuple[_Card, ...]:
    """Return the cards of a group; each names its goals if they differ between conditions."""
    alike = headlines(everyone).label == "all"
    return tuple(
        _card(summary, headline.summary, () if alike else headline.goals)
        for summary, headline in zip(members, headlines(members).by_condition, strict=True)
    )


def _sections(conditions: Sequence[ConditionSummary], tables: Sequence[ReportTable]) -> list[_Section]:
    """Group the tables by condition; tables of several conditions come first."""
    sections = [
        _Section(f"fold-{table.name}", table.title, "", (table,)) for table in tables if table.condition is None
    ]
    for summary in conditions:
        own = tuple(table for table in tables if table.condition == summary.condition.number)
        if own:
            card = _card(summary, summary.total)
            words = f"{card.rate} {card.interval}, {summary.total.successes}/{summary.total.episodes}"
            sections.append(_Section(f"condition-{summary.condition.number}", card.title, words, own))
    return sections


@cache
def page_environment() -> "Environment":
    """Return the template environment of all pages."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("vsnbench.report.formats", "page"), autoescape=True, undefined=StrictUndefined
    )
    environment.filters["sanitize"] = lambda value: sanitize(str(value))
    environment.filters["breakable"] = _breakable
    return environment


def page_part(name: str) -> str:
    """Return the content of a page file."""
    return resources.files("vsnbench.report.formats").joinpath("page", name).read_text(encoding="utf-8")


def _card(summary: ConditionSummary, total: Summary, goals: Sequence[str] = ()) -> _Card:
    """Return the card of a condition over `total`, with the names of these goals."""
    interval = total.interval
    known = total.episodes > 0
    low, high = (100 * interval.low, 100 * interval.high) if known else (0.0, 0.0)
    rate = f"{100 * total.success_rate:.1f} %" if known else "–"
    span = f"[{low:.1f}, {high:.1f}]" if known else ""
    words = f"{total.successes}/{total.episodes} episodes, {total.episodes}/{total.planned} trials completed"
    if goals:
        words = f"{sanitize(listed(goals))}: {words}"
    if total.void:
        words += f", {total.void} void"
    if total.repeats:
        words += f"; {total.repeats}"
    return _Card(
        number=summary.condition.number,
        title=sanitize(summary.condition.name),
        rate=rate,
        interval=span,
        bar_label=f"success rate {rate}, interval {span}" if known else "no completed trial",
        low=f"{low:.2f}",
        width=f"{high - low:.2f}",
        at=f"{100 * total.success_rate if known else 0:.2f}",
        words=f"{words}; {summary.condition.environment}, {sanitize(summary.condition.site)}",
    )


def _figures(drawings: Sequence[Drawing]) -> list[_Figure]:
    """Return the figures; further trajectories are collapsed."""
    trajectories = [drawing.name for drawing in drawings if drawing.name.startswith("trajectories")]
    folded = trajectories[MAX_OPEN_PLANS:]
    return [_figure(drawing, folded=drawing.name in folded) for drawing in drawings]


def _figure(drawing: Drawing, *, folded: bool) -> _Figure:
    return _Figure(
        name=f"figure-{drawing.name}",
        title=drawing.title,
        alt=drawing.alt,
        caption=drawing.caption,
        footnotes=drawing.footnotes,
        data=base64.b64encode(drawing.svg()).decode(),
        wide=drawing.width_in > COLUMN_IN * 1.2,
        width_rem=f"{drawing.width_in * 9:.1f}",
        shape=f"{drawing.width_in:.3f}/{drawing.height_in:.3f}",
        folded=folded,
    )


def _viewing(record: ReportData, episodes: Sequence[_Episode]) -> str:
    """Return the command that opens the first episode in Rerun."""
    if not episodes:
        return ""
    where = f" --results {shlex.quote(str(record.results_directory))}" if record.results_directory else ""
    return sanitize(f"vsnbench view {episodes[0].number}{where}")


def _breakable(text: object) -> "Markup":
    """Allow line breaks within names such as `simulated_recall=0.4` at `_` and `=` only."""
    from markupsafe import Markup, escape

    return Markup(re.sub(r"([_=])(?=\w)", r"\1<wbr>", str(escape(sanitize(str(text))))))  # noqa: S704 - escaped before


def _episodes(record: ReportData) -> Iterator[_Episode]:
    titles = {condition.number: sanitize(condition.name) for condition in record.conditions}
    success_m = {condition.number: condition.success_distance_m for condition in record.conditions}
    strips = 0
    columns = (
        *("episode", "condition", "goal", "start", "repetition", "state", "end_reason", "success", "actions"),
        *("distance_m", "spl", "started_at", "images_directory"),
    )
    rows = record.episodes.iloc[:MAX_EPISODES]
    for values in zip(*(rows[name].tolist() for name in columns), strict=True):
        number, condition, goal, start, repetition, state, reason, success, actions, distance, spl, began, images = (
            values
        )
        outcome = ("success" if success else "failure") if state == COUNTED else str(state)
        words = outcome if success and state == COUNTED else f"{outcome}: {reason}" if reason else outcome
        strip = None
        if strips < MAX_FRAME_STRIPS and record.results_directory and images:
            strip = frame_strip(record.results_directory, images)
            strips += strip is not None
        cells = (
            count(number),
            word(titles[condition]),
            word(sanitize(str(goal))),
            count(start),
            count(repetition),
            word(sanitize(words)),
            count(actions),
            goal_distance(distance, success_m[condition]),
            decimal(spl, 3),
            word(f"{began:%Y-%m-%d %H:%M}"),
        )
        yield _Episode(
            number=number,
            cells=tuple((cell, number) for cell, (_, number) in zip(cells, _EPISODE_COLUMNS, strict=True)),
            outcome=outcome,
            strip=base64.b64encode(strip.jpeg).decode() if strip else "",
            frames=strip.frames if strip else 0,
            alt=f"Frames of episode {number}: {sanitize(str(goal))} from position {start}, {sanitize(words)}.",
        )
