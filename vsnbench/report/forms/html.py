"""The report as one HTML page: no network, tables that sort, figures and pictures inline, dark and light."""

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
from vsnbench.database.read_model import COUNTED
from vsnbench.harmless_text import harmless
from vsnbench.report.build import Report
from vsnbench.report.figures.style import COLUMN_IN, Drawing
from vsnbench.report.peers import is_competitor
from vsnbench.report.record import Record
from vsnbench.report.sheets import Cell, Sheet, count, decimal, footnotes_of, word
from vsnbench.report.strips import strip_of
from vsnbench.report.summary import ConditionSummary

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

MOST_EPISODES = 1000
MOST_PLANS_OPEN = 2
MOST_STRIPS = 250
"""The page stays a file that a browser opens at once."""


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
class _Shelf:
    """Cards of one kind, apart from the others."""

    kind: str
    heading: str
    cards: tuple[_Card, ...]


@dataclass(frozen=True, slots=True)
class _Fold:
    """Tables that open together."""

    name: str
    title: str
    words: str
    sheets: tuple[Sheet, ...]


@dataclass(frozen=True, slots=True)
class _Figure:
    name: str
    title: str
    alt: str
    caption: str
    footnotes: tuple[str, ...]
    data: str
    wide: bool
    """It takes a line of its own."""
    width_rem: str
    shape: str
    """Its width over its height, so that the page does not move when it is drawn."""
    folded: bool
    """It is closed until it is asked for: the page is to stay short."""


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

GLOSSARY = (
    ("k/n, SR", "Successful episodes of the episodes that count, one a trial; the success rate is their share."),
    (
        "95 % interval",
        (
            "Wilson's interval at the effective sample size, which is less than n where episodes share a starting "
            "position: rates outside it are hard to reconcile with what was seen."
        ),
    ),
    (
        "success",
        (
            "The model chose STOP nearer than the success distance to the footprint of the nearest instance of the "
            "goal, in fewer actions than the cap, with no collision."
        ),
    ),
    ("actions", "Mean over all episodes, as the paper averages; the second column is over the successful ones only."),
    ("SPL, SoftSPL", "Success, or progress, weighted by the shortest way over the way driven; 0 to 1."),
    ("done", "Trials done of trials planned. Rates of unfinished campaigns can still move."),
    (
        "void",
        "Attempts that were no result (failed motion, lost sensor, model error, abortion, crash).",
    ),
)


def html_page(report: Report, sheets: Sequence[Sheet], drawings: Sequence[Drawing]) -> str:
    """Return the page as text."""
    template = page_environment().get_template("page.html.j2")
    script, style = page_part("page.js"), page_part("page.css")
    results = report.results
    episodes = list(_episodes(report.record))
    whole = len(report.record.episodes)
    lead = f"All {whole} episodes." if whole <= len(episodes) else f"The first {len(episodes)} of {whole} episodes."
    if strips := sum(bool(episode.strip) for episode in episodes):
        few = f" of the first {strips} that have any" if strips == MOST_STRIPS else ""
        lead += f" Pictures: five frames from the first to the last{few}."
    if without := int((report.record.episodes["images_directory"] == "").sum()):
        lead += f" {without} of all keep no images."
    from markupsafe import Markup

    return template.render(
        table=page_environment().get_template("table.html.j2").module.table,  # type: ignore[attr-defined]
        version=__version__,
        title="vsnbench report",
        lead=f"{results.episodes} of {sum(one.total.planned for one in results.conditions)} planned trials done; "
        f"{len(results.conditions)} condition{'s' if len(results.conditions) > 1 else ''}.",
        script=Markup(script),  # noqa: S704 - our own files, not text from the record
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        style=Markup(style),  # noqa: S704
        questions=report.questions,
        shelves=_shelves(results.conditions),
        folds=_folds(results.conditions, sheets),
        figures=_figures(drawings),
        episodes=episodes,
        episodes_lead=lead,
        episode_columns=_EPISODE_COLUMNS,
        viewing=_viewing(report.record, episodes),
        glossary=GLOSSARY,
        names=footnotes_of(sheets),
        footer=f"Made by vsnbench {__version__} from the record alone.",
    )


def _shelves(conditions: Sequence[ConditionSummary]) -> list[_Shelf]:
    """Set apart who can be compared, what is an upper bound, and what is too little to compare."""
    peers = [one for one in conditions if is_competitor(one)]
    bounds = [one for one in conditions if one.condition.surveyed]
    few = [one for one in conditions if one not in peers and one not in bounds]
    shelves = (
        ("peers", "Success rate over all goals, 95 % interval", peers),
        ("few", "Too little to compare", few),
        ("bounds", "Upper bounds: handed the site, no competitors", bounds),
    )
    return [_Shelf(kind, heading, tuple(map(_card, members))) for kind, heading, members in shelves if members]


def _folds(conditions: Sequence[ConditionSummary], sheets: Sequence[Sheet]) -> list[_Fold]:
    """Fold the tables of a condition together; what is about several stands by itself, and first."""
    folds = [_Fold(f"fold-{sheet.name}", sheet.title, "", (sheet,)) for sheet in sheets if sheet.condition is None]
    for one in conditions:
        own = tuple(sheet for sheet in sheets if sheet.condition == one.condition.number)
        if own:
            card = _card(one)
            words = f"{card.rate} {card.interval}, {one.total.successes}/{one.total.episodes}"
            folds.append(_Fold(f"condition-{one.condition.number}", card.title, words, own))
    return folds


@cache
def page_environment() -> "Environment":
    """Return what makes every page: its templates, and the filters that they use."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("vsnbench.report.forms", "page"), autoescape=True, undefined=StrictUndefined
    )
    environment.filters["harmless"] = lambda value: harmless(str(value))
    environment.filters["breakable"] = _breakable
    return environment


def page_part(name: str) -> str:
    """Return a file of the pages, as it is."""
    return resources.files("vsnbench.report.forms").joinpath("page", name).read_text(encoding="utf-8")


def _card(one: ConditionSummary) -> _Card:
    total, interval = one.total, one.total.interval
    known = total.episodes > 0
    low, high = (100 * interval.low, 100 * interval.high) if known else (0.0, 0.0)
    rate = f"{100 * total.success_rate:.1f} %" if known else "–"
    span = f"[{low:.1f}, {high:.1f}]" if known else ""
    words = f"{total.successes}/{total.episodes} episodes, {total.episodes}/{total.planned} trials done"
    if total.void:
        words += f", {total.void} void beside"
    if total.repeats:
        words += f"; {total.repeats}"
    return _Card(
        number=one.condition.number,
        title=harmless(one.condition.name),
        rate=rate,
        interval=span,
        bar_label=f"success rate {rate}, interval {span}" if known else "no trial is done",
        low=f"{low:.2f}",
        width=f"{high - low:.2f}",
        at=f"{100 * total.success_rate if known else 0:.2f}",
        words=f"{words}; {one.condition.environment}, {harmless(one.condition.site)}",
    )


def _figures(drawings: Sequence[Drawing]) -> list[_Figure]:
    """Return the figures; trajectories of more conditions than a few are folded."""
    trajectories = [drawing.name for drawing in drawings if drawing.name.startswith("trajectories")]
    folded = trajectories[MOST_PLANS_OPEN:]
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


def _viewing(record: Record, episodes: Sequence[_Episode]) -> str:
    """Return the command that opens the first episode in Rerun."""
    if not episodes:
        return ""
    where = f" --results {shlex.quote(str(record.results_directory))}" if record.results_directory else ""
    return harmless(f"vsnbench view {episodes[0].number}{where}")


def _breakable(text: object) -> "Markup":
    """Return text that may be broken where its words join (`simulated_recall=0.4`), and not in the middle of one."""
    from markupsafe import Markup, escape

    return Markup(re.sub(r"([_=])(?=\w)", r"\1<wbr>", str(escape(harmless(str(text))))))  # noqa: S704 - escaped before


def _episodes(record: Record) -> Iterator[_Episode]:
    titles = {one.number: harmless(one.name) for one in record.conditions}
    strips = 0
    columns = (
        *("episode", "condition", "goal", "start", "repetition", "state", "end_reason", "success", "actions"),
        *("distance_m", "spl", "started_at", "images_directory"),
    )
    rows = record.episodes.iloc[:MOST_EPISODES]
    for values in zip(*(rows[name].tolist() for name in columns), strict=True):
        number, condition, goal, start, repetition, state, reason, success, actions, distance, spl, began, images = (
            values
        )
        outcome = ("success" if success else "failure") if state == COUNTED else str(state)
        words = outcome if success and state == COUNTED else f"{outcome}: {reason}" if reason else outcome
        strip = None
        if strips < MOST_STRIPS and record.results_directory and images:
            strip = strip_of(record.results_directory, images)
            strips += strip is not None
        cells = (
            count(number),
            word(titles[condition]),
            word(harmless(str(goal))),
            count(start),
            count(repetition),
            word(harmless(words)),
            count(actions),
            decimal(distance, 2),
            decimal(spl, 3),
            word(f"{began:%Y-%m-%d %H:%M}"),
        )
        yield _Episode(
            number=number,
            cells=tuple((cell, number) for cell, (_, number) in zip(cells, _EPISODE_COLUMNS, strict=True)),
            outcome=outcome,
            strip=base64.b64encode(strip.jpeg).decode() if strip else "",
            frames=strip.frames if strip else 0,
            alt=f"Frames of episode {number}: {harmless(str(goal))} from position {start}, {harmless(words)}.",
        )
