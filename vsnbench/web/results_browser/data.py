"""The JSON documents of the page, from a server or as the files of a static site.

Blinded studies stay blinded: every query goes through `vsnbench.results.reading`.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Final

from sqlalchemy import Engine, func, select, union_all

from vsnbench.report.analysis.reading import read_courses
from vsnbench.results.annotations import NOTE, TAGGED, UNTAGGED
from vsnbench.results.files.film import RecordedFrame, film_of
from vsnbench.results.files.images import further_images
from vsnbench.results.goals import with_goals
from vsnbench.results.model import FACTS, ROW, EpisodeRecord
from vsnbench.results.reading.queries import episode_record, episode_rows, episode_steps
from vsnbench.results.reading.read_model import CODE, episodes_of_campaigns
from vsnbench.results.schema import tables
from vsnbench.results.schema.engine import reading, record_errors
from vsnbench.sites.site import Site
from vsnbench.sites.targets import targets_of
from vsnbench.values.decision_check import SHOWN
from vsnbench.values.pose import Pose
from vsnbench.values.step import StepRecord, driven_path, image_offset, lasted_s

SCHEMA: Final = 1
COLUMNS: Final = tuple(
    {"campaign_id": "campaign", "images_directory": "has_images"}.get(name, name) for name in ROW.names
)
"""Columns of the rows of `episodes_json`."""
_MAX_TEXT = 4000
_CARD_POINTS = 60
"""Maximum number of points of the path on a card."""


def _rounded(value: float | None, places: int) -> float | None:
    return round(value, places) if value is not None and math.isfinite(value) else None


_SHORTEN: Final[Mapping[str, Callable[[Any], Any]]] = {
    "end_reason": lambda reason: reason or "",
    "distance_m": partial(_rounded, places=3),
    "path_m": partial(_rounded, places=2),
    "shortest_m": partial(_rounded, places=2),
    "duration_s": partial(_rounded, places=1),
    "started_at": lambda moment: f"{moment:%Y-%m-%d %H:%M:%S}",
    "images_directory": bool,
}
_SHORTENED: Final = tuple((ROW.names.index(name), shorten) for name, shorten in _SHORTEN.items())


def version_of(engine: Engine) -> str:
    """Return a text that changes when an episode, a step, a verdict or a note is added.

    Raises:
        RecordError: the database cannot be read.
    """
    running = select(tables.EpisodeRow.id).where(tables.IS_ACTIVE).scalar_subquery()
    with record_errors(engine), reading(engine).begin() as connection:
        numbers = [
            connection.scalar(query) or 0
            for query in (
                select(func.max(tables.EpisodeRow.id)),
                select(func.max(tables.VerdictRow.id)),
                select(func.max(tables.EventRow.id)),
                select(func.count()).select_from(tables.EpisodeRow).where(tables.IS_ACTIVE),
                select(func.count()).select_from(tables.StepRow).where(tables.StepRow.episode_id.in_(running)),
            )
        ]
    return "-".join(map(str, numbers))


def episodes_json(engine: Engine) -> dict[str, Any]:
    """Return all episodes as rows of `COLUMNS`, by number, with their notes and the versions of their models.

    `notes` has the notes of those episodes that have some, by number. `versions` has the weights and the first digits
    of the hash of each campaign's model; none for an arm of a blinded study.

    Raises:
        RecordError: the database cannot be read.
    """
    version = version_of(engine)
    rows = [_shown(row) for row in episode_rows(engine, ROW)]
    notes: dict[int, list[str]] = {}
    with record_errors(engine), reading(engine).begin() as connection:
        for number, text in connection.execute(_NOTES):
            notes.setdefault(number, []).append(text[:_MAX_TEXT])
        versions = {
            campaign: f"{label} {sha256[:8]}".strip() for campaign, label, sha256 in connection.execute(_VERSIONS)
        }
    return {
        "schema": SCHEMA,
        "version": version,
        "columns": COLUMNS,
        "rows": rows,
        "notes": notes,
        "versions": versions,
    }


_NOTES: Final[Any] = union_all(
    select(tables.EventRow.episode_id, tables.EventRow.text).where(
        tables.EventRow.kind == NOTE, tables.EventRow.episode_id.is_not(None)
    ),
    select(tables.VerdictRow.episode_id, tables.VerdictRow.note).where(tables.VerdictRow.note != ""),
)
_VERSIONS: Final = (
    select(tables.CampaignRow.id, tables.ModelRow.weights_label, tables.ModelRow.sha256)
    .join(tables.ModelRow, tables.ModelRow.id == tables.CampaignRow.model_id)
    .where(CODE.is_(None))
)


def _shown(row: list[Any]) -> list[Any]:
    """Return a row as the page shows it: without more digits, seconds or text than there is room for."""
    for place, shorten in _SHORTENED:
        row[place] = shorten(row[place])
    return row


def episode_json(engine: Engine, number: int) -> dict[str, Any]:
    """Return one episode with its steps, verdicts and notes.

    Poses are [x, y, heading] in the site's frame, metres and radians. `path` has the pose before each step and the one
    at the end; it comes from odometry where the pose in the site is unknown. `pose` of a step is that of its image.
    `film` of a step has a row for each image until the next answer: time, x, y, heading, and the velocity that a stack
    commanded then (m/s, m/s, rad/s). Times are seconds on the robot's clock. `cameras` of a step has the roles of the
    further cameras that it has images of; steps of a robot with one camera do not have it.

    Raises:
        UsageError: the episode does not exist.
        RecordError: the database cannot be read.
    """
    return page_of(episode_record(engine, number), episode_steps(engine, number))


def cards_json(engine: Engine, numbers: Sequence[int]) -> dict[int, dict[str, Any]]:
    """Return by number what the cards of some episodes show besides their rows.

    `image` is the number of the last step with an image, null without one. `path` has positions in the site, metres;
    it is empty where they are unknown.

    Raises:
        RecordError: the database cannot be read.
    """
    last = select(tables.StepRow.episode_id, func.max(tables.StepRow.number)).group_by(tables.StepRow.episode_id)
    last = last.where(tables.StepRow.episode_id.in_(numbers), tables.StepRow.rgb_digest.is_not(None))
    sites = episodes_of_campaigns(tables.EpisodeRow.id, tables.SiteRow.sha256)
    with record_errors(engine), reading(engine).begin() as connection:
        images = dict(connection.execute(last).all())
        known = connection.execute(sites.where(tables.EpisodeRow.id.in_(numbers))).all()
    courses = read_courses(engine, numbers)
    return {
        number: {
            "image": images.get(number),
            "path": _thinned(courses[number].poses if number in courses else ()),
            "site_sha256": sha256,
        }
        for number, sha256 in known
    }


def _thinned(poses: Sequence[Pose]) -> list[list[float]]:
    """Return positions at which the robot was, evenly chosen, with the first and the last."""
    points = [point for point, _ in itertools.groupby(pose.position for pose in poses)]
    every = max(1, math.ceil(len(points) / _CARD_POINTS))
    chosen = points[::every] if (len(points) - 1) % every == 0 else [*points[::every], points[-1]]
    return [[round(x, 2), round(y, 2)] for x, y in chosen]


def page_of(episode: EpisodeRecord, steps: tuple[StepRecord, ...]) -> dict[str, Any]:
    """Return what `episode_json` returns of an episode that has been read."""
    provenance = episode.provenance
    site, start = site_of(episode), episode.placement.pose if episode.placement else None
    if start is None and site is not None:
        start = next((place.pose for place in site.starts if place.number == episode.start), None)
    path = driven_path(start, steps) if start is not None else []
    return {
        "schema": SCHEMA,
        "row": dict(zip(COLUMNS, _shown(list(ROW.json(episode).values())), strict=True)),
        "uuid": episode.uuid,
        "seed": episode.seed,
        "weights": provenance.weights_label,
        "max_actions": provenance.protocol.get("max_actions"),
        "execution": episode.execution,
        "success_distance_m": episode.success_distance_m,
        "error": episode.error[:_MAX_TEXT],
        **({"facts": facts} if (facts := _facts(episode)) else {}),
        **({"stopped": episode.stopped.words} if episode.stopped else {}),
        "targets": sorted(target.id for target in targets_of(site, episode.goal)) if site else [],
        "site_sha256": provenance.site_sha256 if site else "",
        "path": [_row(pose) for pose in path],
        "steps": [_step(step) | {"pose": pose} for step, pose in zip(steps, _image_poses(path, steps), strict=True)],
        "verdicts": [
            {
                "at": f"{verdict.created_at:%Y-%m-%d %H:%M:%S}",
                "proposed": verdict.proposed,
                "success": verdict.success,
                "reason": verdict.reason,
                "author": verdict.author,
                "source": verdict.source,
                "note": verdict.note,
            }
            for verdict in episode.verdicts
        ],
        "events": [
            {
                "at": f"{event.created_at:%Y-%m-%d %H:%M:%S}",
                "step": event.step_number,
                "kind": event.kind,
                "author": event.author,
                "text": event.statement[:_MAX_TEXT],
                "is_note": event.kind in (NOTE, TAGGED, UNTAGGED),
            }
            for event in episode.events
        ],
    }


def _facts(episode: EpisodeRecord) -> dict[str, str]:
    """Return `FACTS` in words, by name; nothing of what is empty or unknown."""
    values = {name.replace("_", " "): value for name, value in FACTS.json(episode).items()}
    values |= {f"goal {leg.position}": leg.text for leg in episode.legs}
    return {name: _fact(value) for name, value in values.items() if value not in (None, "", [], {})}


def _fact(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return (f"{value:.4g}" if isinstance(value, float) else str(value))[:_MAX_TEXT]


def site_of(episode: EpisodeRecord) -> Site | None:
    """Return the recorded site; None if it is unknown, as in some imports, or damaged."""
    return _valid_site(episode.provenance.site_content)


def _valid_site(content: object) -> Site | None:
    try:
        return Site.model_validate(content)
    except (ValueError, TypeError, AttributeError, RecursionError):
        return None


def recorded_site(engine: Engine, sha256: str) -> Site | None:
    """Return the site with a hash, as of the first campaign in it; None if it is unknown or damaged.

    Raises:
        RecordError: the database cannot be read.
    """
    query = (
        select(tables.SiteRow.content, tables.CampaignRow.id)
        .join(tables.CampaignRow, tables.CampaignRow.site_id == tables.SiteRow.id)
        .where(tables.SiteRow.sha256 == sha256)
        .order_by(tables.CampaignRow.id)
        .limit(1)
    )
    with record_errors(engine), reading(engine).begin() as connection:
        row = connection.execute(query).first()
        return None if row is None else _valid_site(with_goals(connection, row.content, [row.id]))


def _row(pose: Pose) -> list[float]:
    return [round(value, 4) for value in (pose.x_m, pose.y_m, pose.heading_rad)]


def _image_poses(path: list[Pose], steps: tuple[StepRecord, ...]) -> Iterator[list[float] | None]:
    """Yield the pose at which the image of each step was taken; None where the start is unknown."""
    odometry = Pose(0.0, 0.0)
    for place, step in enumerate(steps):
        yield _row(path[place].compose(image_offset(step, odometry))) if path else None
        odometry = step.after or odometry


def _step(step: StepRecord) -> dict[str, Any]:
    collision, answer = step.result.collision if step.result else None, step.answer
    return {
        "number": step.number,
        "action": step.movement.text if step.movement is not None else step.action.value,
        "raw_action": step.raw_action,
        "blocked": step.blocked,
        "refusal": step.refusal,
        "failure": step.result.failure if step.result else "",
        "touched": (collision.touched or "unknown object") if collision else "",
        "time_s": _rounded(step.stamp_s, 2),
        "until_s": None
        if step.stamp_s is None
        else _rounded(step.stamp_s + lasted_s(step.stamp_s, step.result, answer), 3),
        "age_s": _rounded(answer.age_s, 3) if answer else None,
        "stale": bool(answer and answer.stale),
        "waiting_s": _rounded(step.result.waiting_s, 2) if step.result else None,
        "film": [_frame(frame) for frame in film_of(step.details)],
        "infer_s": _rounded(step.timings.infer_s, 3),
        "scores": {name: round(score, 4) for name, score in step.probabilities.items() if _is_number(score)},
        "values": _values(step.details),
        "note": _note(step.details),
        "has_image": step.rgb_digest is not None,
        **({"cameras": cameras} if (cameras := further_images(step.details)) else {}),
    }


def _frame(frame: RecordedFrame) -> list[float]:
    at = frame.moment
    place = (at.pose.x_m, at.pose.y_m, at.pose.heading_rad, *(frame.commanded or ()))
    return [round(at.stamp_s, 3), *(round(value, 4) for value in place)]


def _values(details: Mapping[str, Any]) -> dict[str, float]:
    """Return the numbers among a model's diagnostics."""
    shown = details.get(SHOWN)
    scalars = shown.get("scalars") if isinstance(shown, dict) else None
    found = {**details, **(scalars if isinstance(scalars, dict) else {})}
    return {str(name)[:80]: round(value, 4) for name, value in found.items() if _is_number(value)}


def _note(details: Mapping[str, Any]) -> str:
    shown = details.get(SHOWN)
    note = shown.get("note") if isinstance(shown, dict) else details.get("note")
    return note[:_MAX_TEXT] if isinstance(note, str) else ""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
