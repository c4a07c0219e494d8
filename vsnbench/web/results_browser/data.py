"""The JSON documents of the page, from a server or as the files of a static site.

Blinded studies stay blinded: every query goes through `vsnbench.results.reading`.
"""

import math
from collections.abc import Mapping
from typing import Any, Final

from sqlalchemy import Connection, Engine, func, select

from vsnbench.results.annotations import NOTE, TAGGED, UNTAGGED
from vsnbench.results.reading.queries import episode_details, episode_steps, list_episodes
from vsnbench.results.reading.read_model import COUNTS, episodes_of_trials
from vsnbench.results.reading.rows import EpisodeDetails, EpisodeFilter, EpisodeSummary
from vsnbench.results.schema.engine import reading, record_errors
from vsnbench.results.schema.tables import IS_ACTIVE, Campaign, Episode, Event, Step, Trial, Verdict
from vsnbench.results.schema.tables import Site as RecordedSite
from vsnbench.sites.site import Site
from vsnbench.sites.targets import targets_of
from vsnbench.values.decision_check import SHOWN
from vsnbench.values.movement import movement_text
from vsnbench.values.pose import Pose
from vsnbench.values.step import StepRecord, driven_path

SCHEMA: Final = 1
COLUMNS: Final = (
    *("id", "model", "campaign", "robot", "simulated", "site", "goal", "start", "repetition", "outcome", "end_reason"),
    *("counts", "actions", "distance_m", "path_m", "shortest_m", "duration_s", "started_at", "has_images", "tags"),
    "disturbances",
)
"""Columns of the rows of `episodes_json`."""
_MAX_TEXT = 4000


def version_of(engine: Engine) -> str:
    """Return a text that changes when an episode, a step, a verdict or a note is added.

    Raises:
        RecordError: the database cannot be read.
    """
    running = select(Episode.id).where(IS_ACTIVE).scalar_subquery()
    with record_errors(engine), reading(engine).begin() as connection:
        numbers = [
            connection.scalar(query) or 0
            for query in (
                select(func.max(Episode.id)),
                select(func.max(Verdict.id)),
                select(func.max(Event.id)),
                select(func.count()).select_from(Episode).where(IS_ACTIVE),
                select(func.count()).select_from(Step).where(Step.episode_id.in_(running)),
            )
        ]
    return "-".join(map(str, numbers))


def episodes_json(engine: Engine) -> dict[str, Any]:
    """Return all episodes as rows of `COLUMNS`, by number.

    Raises:
        RecordError: the database cannot be read.
    """
    version = version_of(engine)
    summaries = list_episodes(engine, EpisodeFilter())
    with record_errors(engine), reading(engine).begin() as connection:
        counted = _counted(connection)
    rows = [_row(summary, summary.id in counted) for summary in summaries]
    return {"schema": SCHEMA, "version": version, "columns": COLUMNS, "rows": rows}


def _counted(connection: Connection) -> set[int]:
    return set(connection.scalars(episodes_of_trials(Episode.id).where(COUNTS)))


def _row(episode: EpisodeSummary, counts: bool) -> list[Any]:
    return [
        *(episode.id, episode.model, episode.campaign_id, episode.robot, episode.simulated, episode.site),
        *(episode.goal, episode.start, episode.repetition, episode.outcome, episode.end_reason or "", counts),
        *(episode.actions, _rounded(episode.distance_to_goal_m, 3), _rounded(episode.path_length_m, 2)),
        *(_rounded(episode.geodesic_start_m, 2), _rounded(episode.duration_s, 1)),
        *(f"{episode.started_at:%Y-%m-%d %H:%M:%S}", bool(episode.images_directory), list(episode.tags)),
        episode.disturbances,
    ]


def episode_json(engine: Engine, number: int) -> dict[str, Any]:
    """Return one episode with its steps, verdicts and notes.

    Poses are [x, y, heading] in the site's frame, metres and radians. `path` has the pose before each step and the one
    at the end; it comes from odometry where the pose in the site is unknown.

    Raises:
        UsageError: the episode does not exist.
        RecordError: the database cannot be read.
    """
    details, steps = episode_details(engine, number), episode_steps(engine, number)
    episode, provenance = details.summary, details.provenance
    site, begin = site_of(details), details.placement
    start = begin.pose if begin else None
    if start is None and site is not None:
        start = next((place.pose for place in site.starts if place.number == episode.start), None)
    return {
        "schema": SCHEMA,
        "row": dict(zip(COLUMNS, _row(episode, details.counts), strict=True)),
        "uuid": episode.uuid,
        "seed": details.seed,
        "weights": provenance.weights_label,
        "max_actions": provenance.protocol.get("max_actions"),
        "success_distance_m": episode.success_distance_m,
        "error": details.error[:_MAX_TEXT],
        "targets": sorted(target.id for target in targets_of(site, episode.goal)) if site else [],
        "site_sha256": provenance.site_sha256 if site else "",
        "path": _path(start, steps),
        "steps": [_step(step) for step in steps],
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
            for verdict in details.verdicts
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
            for event in details.events
        ],
    }


def site_of(details: EpisodeDetails) -> Site | None:
    """Return the recorded site; None if it is unknown, as in some imports, or damaged."""
    try:
        return Site.model_validate(details.provenance.site_content)
    except (ValueError, TypeError, AttributeError, RecursionError):
        return None


def recorded_site(engine: Engine, sha256: str) -> Site | None:
    """Return the site with a hash, as of the first campaign in it; None if it is unknown or damaged.

    Raises:
        RecordError: the database cannot be read.
    """
    query = (
        select(Episode.id)
        .join(Trial, Trial.id == Episode.trial_id)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .join(RecordedSite, RecordedSite.id == Campaign.site_id)
        .where(RecordedSite.sha256 == sha256)
        .limit(1)
    )
    with record_errors(engine), reading(engine).begin() as connection:
        number = connection.scalar(query)
    return None if number is None else site_of(episode_details(engine, number))


def _path(start: Pose | None, steps: tuple[StepRecord, ...]) -> list[list[float]]:
    if start is None:
        return []
    poses = driven_path(start, steps)
    return [[round(value, 4) for value in (pose.x_m, pose.y_m, pose.heading_rad)] for pose in poses]


def _step(step: StepRecord) -> dict[str, Any]:
    collision = step.result.collision if step.result else None
    return {
        "number": step.number,
        "action": movement_text(step.movement) if step.movement is not None else step.action.value,
        "raw_action": step.raw_action,
        "blocked": step.blocked,
        "refusal": step.refusal,
        "failure": step.result.failure if step.result else "",
        "touched": (collision.touched or "unknown object") if collision else "",
        "time_s": _rounded(step.stamp_s, 2),
        "infer_s": _rounded(step.timings.infer_s, 3),
        "scores": {name: round(score, 4) for name, score in step.probabilities.items() if _is_number(score)},
        "values": _values(step.details),
        "note": _note(step.details),
        "has_image": step.rgb_digest is not None,
    }


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


def _rounded(value: float | None, places: int) -> float | None:
    return round(value, places) if value is not None and math.isfinite(value) else None
