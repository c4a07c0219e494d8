"""Says in sentences what a person would see in an episode, and what a model's author can do about it."""

import math
import statistics
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from sqlalchemy import Engine

from vsnbench.protocol.course import CourseMap
from vsnbench.protocol.judge import EndReason
from vsnbench.report.analysis.courses import course_of
from vsnbench.report.analysis.failures import FailureKind, failure_kind
from vsnbench.results.fields import Fields, fields_of, quantity
from vsnbench.results.model import EPISODE, EpisodeRecord
from vsnbench.results.reading.queries import episode_record, episode_steps
from vsnbench.text.distances import distance_text
from vsnbench.text.sanitize import counted, duration_text
from vsnbench.values.movement import Action, Move
from vsnbench.values.step import StepRecord

_STILL_M = 0.5
"""A path that is shorter than this has not left its place."""
_HALF_TURN_RAD = math.pi + 1e-6
_REST = (Action.STOP, Action.NOOP)
_PLURALS = {"trajectory": "trajectories", "velocity": "velocities"}


@dataclass(frozen=True, slots=True)
class EpisodeDiagnosis:
    """What happened in an episode, beyond its result."""

    cause: str | None = quantity("cause of the failure, as in reports", absent="for a success and without a verdict")
    answers: str = quantity("kind of the model's answers: `action`, or that of all its movements")
    same_action: str | None = quantity("the only action that the model answered", absent="if there are several")
    blocked: int = quantity("number of blocked answers")
    blocked_at: str | None = quantity(
        "what was ahead most often: `wall`, or an object of the site", absent="if nothing was blocked or is known"
    )
    blocked_there: int = quantity("number of answers that were blocked there")
    wide_turns: int = quantity("number of turns by more than 180° that the model asked for")
    in_view_from: int | None = quantity("action at which the goal was first in view", absent="if it never was")
    stop_from: int | None = quantity("action from which STOP would have succeeded", absent="if it never would have")
    answered_stop: bool = quantity("the model answered STOP")
    infer_median_s: float | None = quantity("median wall time of an answer")
    infer_max_s: float | None = quantity("longest wall time of an answer")
    move_median_s: float | None = quantity("median duration of a motion on the robot's clock", absent="without motions")


_OF_EPISODE = EPISODE.only(
    *("id", "goal", "start", "outcome", "end_reason", "error", "actions", "distance_m", "path_m", "shortest_m")
)
TRIED = Fields([*_OF_EPISODE, *fields_of(EpisodeDiagnosis)])
"""Quantities of `as_fields`."""


def as_fields(episode: EpisodeRecord, found: EpisodeDiagnosis) -> dict[str, Any]:
    """Return an episode and what happened in it as a JSON object."""
    return {**_OF_EPISODE.json(episode), **asdict(found)}


def diagnose(engine: Engine, number: int) -> tuple[EpisodeRecord, EpisodeDiagnosis]:
    """Return an episode of a record and what happened in it.

    Raises:
        UsageError: the episode does not exist.
        RecordError: it cannot be read.
    """
    episode, steps = episode_record(engine, number), episode_steps(engine, number)
    ground, course, approach = course_of(engine, episode)
    cause = None
    if episode.success is False:
        distance_m = math.nan if episode.distance_m is None else episode.distance_m
        within_m = episode.success_distance_m or 1.0
        cause = failure_kind(episode.end_reason, distance_m, course, approach, within_m).value
    names = {step.raw_action or step.action.value for step in steps}
    places = Counter(_blocked_places(ground, episode, steps))
    place, there = places.most_common(1)[0] if places else (None, 0)
    in_view = None if approach is None or approach.in_view is None else approach.in_view
    inferred = [step.timings.infer_s for step in steps if step.timings.infer_s is not None]
    moved = [step.result.duration_s for step in steps if step.result and step.result.duration_s > 0]
    return episode, EpisodeDiagnosis(
        cause=cause,
        answers=_kind_of_answers(steps),
        same_action=names.pop() if len(names) == 1 else None,
        blocked=sum(step.blocked for step in steps),
        blocked_at=place,
        blocked_there=there,
        wide_turns=sum(
            isinstance(step.movement, Move) and abs(step.movement.turn_rad) > _HALF_TURN_RAD for step in steps
        ),
        in_view_from=None if in_view is None or not in_view.any() else int(in_view.argmax()) + 1,
        stop_from=None if approach is None or not approach.reached.any() else int(approach.reached.argmax()) + 1,
        answered_stop=any(step.action is Action.STOP for step in steps),
        infer_median_s=statistics.median(inferred) if inferred else None,
        infer_max_s=max(inferred, default=None),
        move_median_s=statistics.median(moved) if moved else None,
    )


def _blocked_places(ground: CourseMap | None, episode: EpisodeRecord, steps: Sequence[StepRecord]) -> Iterable[str]:
    """Yield what was ahead of the robot at each blocked answer."""
    if ground is None or episode.placement is None:
        return
    pose = episode.placement.pose
    for step in steps:
        if step.world is not None:
            pose = step.world.pose
        if step.blocked and (ahead := ground.solid_ahead(pose)):
            yield ahead


def _kind_of_answers(steps: Sequence[StepRecord]) -> str:
    kinds = {None if step.movement is None else step.movement.kind for step in steps if step.action not in _REST}
    kind = kinds.pop() if len(kinds) == 1 else None
    return "action" if kind is None else kind.value


def headline(episode: EpisodeRecord, found: EpisodeDiagnosis) -> str:
    """Return the result of an episode: `chair from 1: failure, turned in circles, 3.2 m from the goal`."""
    parts: list[str] = [episode.outcome]
    if found.cause is not None:
        parts.append(found.cause)
    if episode.outcome == "void":
        parts.append(episode.error or episode.end_reason or "")
    elif episode.distance_m is not None and math.isfinite(episode.distance_m):
        parts.append(f"{distance_text(episode.distance_m, episode.success_distance_m)} m from the goal")
    return f"{episode.goal} from {episode.start}: {', '.join(filter(None, parts))}"


def story(episode: EpisodeRecord, found: EpisodeDiagnosis) -> str:
    """Return what happened on the way, as one sentence with semicolons; empty for an episode without actions."""
    if not episode.actions:
        return ""
    number = episode.actions
    name = _PLURALS.get(found.answers, f"{found.answers}s")
    if found.blocked:
        at = ""
        if found.blocked_at is not None:
            place = "a wall" if found.blocked_at == "wall" else f"the {found.blocked_at}"
            at = (
                f" at {place}"
                if found.blocked_there == found.blocked
                else f", {found.blocked_there} of them at {place}"
            )
        first = f"{found.blocked} of {number} {name} {'was' if found.blocked == 1 else 'were'} blocked{at}"
    elif found.same_action is not None and found.answers == "action" and number > 1:
        first = f"all {number} actions were {found.same_action}"
    else:
        first = counted(number, found.answers, name)
    parts = [first if episode.path_m is None else f"{first}; {episode.path_m:.1f} m driven"]
    seen = found.in_view_from
    if episode.outcome != "void":
        parts.append(
            "the goal was never in view"
            if seen is None
            else "the goal was in view from the start"
            if seen == 1
            else f"the goal was in view from action {seen}"
        )
    if episode.success is False and found.stop_from is not None:
        parts.append(f"STOP would have succeeded from action {found.stop_from}")
    return "; ".join(parts)


def timing(episodes: Iterable[EpisodeDiagnosis]) -> str:
    """Return how long the model took for an answer: `median 40 ms an action, at most 120 ms`; empty if unknown."""
    known = [(e.infer_median_s, e.infer_max_s) for e in episodes if e.infer_median_s is not None]
    if not known:
        return ""
    median_s = statistics.median(median for median, _ in known)
    return f"median {_duration(median_s)} an action, at most {_duration(max(most or 0.0 for _, most in known))}"


def _duration(seconds: float) -> str:
    return f"{1000 * seconds:.{0 if seconds >= 0.01 else 1}f} ms" if seconds < 1 else f"{seconds:.1f} s"


def advice(episodes: Sequence[tuple[EpisodeRecord, EpisodeDiagnosis]], max_actions: int | None) -> list[str]:
    """Return what the author of the model can do, the most important first; empty if nothing is conspicuous.

    Args:
        episodes: episodes of one model.
        max_actions: the protocol's number of actions; None for no limit. Trials may have had fewer.
    """
    lines: list[str] = []
    for episode, found in episodes:
        lines += _advice(episode, found, max_actions)
    medians = [(f.infer_median_s, f.move_median_s) for _, f in episodes if f.infer_median_s and f.move_median_s]
    if medians:
        infer_s, move_s = (statistics.median(values) for values in zip(*medians, strict=True))
        if infer_s > move_s:
            whole = (
                "" if max_actions is None else f": {max_actions} take {duration_text(max_actions * (infer_s + move_s))}"
            )
            lines.append(
                f"slow: a robot waits {_duration(infer_s)} for an answer and moves for {_duration(move_s)}{whole}"
            )
    return list(dict.fromkeys(lines))


def _advice(episode: EpisodeRecord, found: EpisodeDiagnosis, max_actions: int | None) -> Iterable[str]:
    if found.wide_turns:
        turns = counted(found.wide_turns, "turn")
        yield f"{turns} by more than 180°: angles are in radians, 90° is math.radians(90)"
    if episode.success is not False:
        return
    within = f"{episode.success_distance_m or 1.0:g} m"
    given = episode.provenance.protocol.get("max_actions", max_actions)
    is_limit = episode.end_reason not in (EndReason.STOP.value, EndReason.COLLISION.value) and given == max_actions
    if found.stop_from is not None and is_limit and not found.answered_stop:
        yield f"it never answers STOP: answer Action.STOP within {within} of the goal"
    if found.cause == FailureKind.STUCK.value:
        yield "a blocked answer moves nothing: turn, or answer another point, instead of repeating"
    elif is_limit and episode.path_m is not None and episode.path_m < _STILL_M and not found.blocked:
        yield "it never drives: check units; depth and pose are in metres, headings in radians"
    elif is_limit and found.cause == FailureKind.CIRCLING.value:
        yield "it ends turning on the spot: check units; depth is in metres, headings in radians"
    if found.cause == FailureKind.STOPPED_FAR.value:
        yield f"it answers STOP too early: STOP succeeds within {within} of the goal"
