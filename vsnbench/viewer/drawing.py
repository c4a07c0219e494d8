"""Logs the entries of an episode to Rerun entities.

Entities: `camera/rgb` (with `detections`), `camera/depth`, `plan/**`, `actions/**` (state lanes), `distance/**`,
`decision/**`, `status`, `events`, `verdict`. Timelines: `step` (number of the action) and `robot_time`.
"""

import collections
from collections.abc import Sequence

import numpy as np
import rerun as rr

from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.episode_entries import Entry, EpisodeHeader, EventEntry, StepEntry
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.text.distances import distance_text
from vsnbench.values.decision import Box
from vsnbench.values.movement import Action
from vsnbench.values.step import StepRecord
from vsnbench.viewer.blueprint import send_layout
from vsnbench.viewer.entity_log import EntityLog
from vsnbench.viewer.plan_layer import FAILURE_RGB, SUCCESS_RGB, FloorPlan
from vsnbench.viewer.static_entities import StaticEntities, cached_entities

_OWN_RGBA = {
    Action.MOVE_FORWARD: 0x3C8DD9FF,
    Action.TURN_LEFT: 0xF2A93BFF,
    Action.TURN_RIGHT: 0x8E6FC1FF,
    Action.MOVE_BACKWARD: 0x5FB3A8FF,
    Action.STOP: 0xD43F3AFF,
    Action.NOOP: 0x9A9A9AFF,
    Action.WAYPOINT: 0x2F9E8FFF,
    Action.MOVE: 0x3C8DD9FF,
    Action.TRAJECTORY: 0x7A9E2FFF,
    Action.VELOCITY: 0xB86FC1FF,
    Action.PIXEL: 0xC77D3BFF,
    Action.SIDESTEP: 0x5FA8D3FF,
}
_OTHER_RGBA = 0x6B7F8CFF
ACTION_RGBA = _OWN_RGBA | {
    action: _OTHER_RGBA for action in Action if action.has_parameters and action not in _OWN_RGBA
}
OUTCOME_RGBA = {
    "moved": 0x9CCC9CFF,
    "stopped": 0xB8B8B8FF,
    "blocked": 0xE0B040FF,
    "collision": 0xCE2C28FF,
    "failed": 0x7A1F1BFF,
}
WARNING_KINDS = frozenset({EndReason.COLLISION.value} | {str(reason) for reason in EndReason if not reason.is_result})
DEPTH_UNITS_PER_METRE = 1000.0


class EpisodeDrawing:
    """Logs the entries of one episode, in order."""

    def __init__(self, log: EntityLog, header: EpisodeHeader, *, with_layout: bool = True) -> None:
        """Log what is known before the first step.

        Args:
            log: receives the entities.
            header: the episode.
            with_layout: also send the layout and the name of the recording; not for one of several episodes in it.
        """
        self._log = log
        self._header = header
        self._with_layout = with_layout
        self._plan = FloorPlan(log, header)
        self._counts: collections.Counter[str] = collections.Counter()
        self._blocked = 0
        self._first_stamp_s: float | None = None
        self._until_s: float | None = None
        """Time until which a robot that drives on has driven."""
        self._with_scores = False
        self._has_boxes = False
        self._begin()

    def draw(self, entry: Entry) -> None:
        """Log one entry."""
        match entry:
            case StepEntry():
                self._step(entry)
            case EventEntry():
                self._event(entry)
            case EpisodeEnd():
                self._end(entry)

    def _begin(self) -> None:
        header, recording = self._header, self._log.stream
        if self._with_layout:
            recording.send_recording_name(
                f"episode {header.episode_id}: {header.model}, {header.goal}, start {header.start_number}"
            )
            send_layout(recording, header, with_scores=False)
        self._plan.draw_site()
        limit_m = header.parameters.success_distance_m
        cached_entities(("curves", limit_m), lambda entities: _draw_curves(entities, limit_m)).send(recording)
        self._set_time(0, None)
        recording.log("verdict", _markdown(_running_text(header)))

    def finish(self) -> None:
        """Send buffered values."""
        self._log.flush()

    def _set_time(self, step: int, stamp_s: float | None) -> None:
        if stamp_s is not None and self._first_stamp_s is None:
            self._first_stamp_s = stamp_s
        first_s = self._first_stamp_s
        self._log.set_time(step, None if stamp_s is None or first_s is None else stamp_s - first_s)

    def _step(self, entry: StepEntry) -> None:
        log = self._log.log
        stamp_s = entry.step.stamp_s
        self._set_time(entry.step.number, float(entry.step.number) if stamp_s is None else stamp_s)
        self._until_s = entry.step.answer.until_s if entry.step.answer else None
        diagnostics = entry.decision.diagnostics
        self._counts[entry.decision.action.value] += 1
        self._blocked += entry.step.blocked
        self._images("camera", entry.rgb_jpeg, entry.depth_png)
        self._detections(diagnostics.boxes)
        for role, images in entry.cameras.items():
            self._images(f"camera_{role}", *images)
        log("actions/action", rr.StateChange, state=[entry.decision.action.value])
        log("actions/outcome", rr.StateChange, state=[_outcome(entry)])
        distance = self._plan.draw_step(entry)
        if distance is not None:
            log("distance/to_goal", rr.Scalars, scalars=[distance])
            log("distance/success_under", rr.Scalars, scalars=[self._header.parameters.success_distance_m])
        self._decision(entry)
        self._log_text("status", self._status_text(entry, distance))
        for frame in entry.film:
            self._set_time(entry.step.number, frame.moment.stamp_s)
            if frame.rgb_jpeg is not None:
                log("camera/rgb", rr.EncodedImage, blob=[frame.rgb_jpeg], media_type=["image/jpeg"])
            self._plan.draw_robot(frame.moment.pose)

    def _images(self, camera: str, rgb_jpeg: bytes | None, depth_png: bytes | None) -> None:
        if rgb_jpeg is not None:
            self._log.log(f"{camera}/rgb", rr.EncodedImage, blob=[rgb_jpeg], media_type=["image/jpeg"])
        if depth_png is not None:
            self._log.log(
                f"{camera}/depth",
                rr.EncodedDepthImage,
                blob=[depth_png],
                media_type=["image/png"],
                meter=[DEPTH_UNITS_PER_METRE],
                depth_range=[[0, 6000]],
            )

    def _log_text(self, entity: str, text: str) -> None:
        self._log.log(entity, rr.TextDocument, text=[text], media_type=[rr.MediaType.MARKDOWN])

    def _detections(self, boxes: tuple[Box, ...]) -> None:
        if boxes or self._has_boxes:
            self._log.log(
                "camera/rgb/detections",
                rr.Boxes2D,
                centers=[((box.left + box.right) / 2, (box.top + box.bottom) / 2) for box in boxes],
                half_sizes=[((box.right - box.left) / 2, (box.bottom - box.top) / 2) for box in boxes],
                labels=[f"{box.label} {box.score:.2f}" for box in boxes],
                colors=[SUCCESS_RGB if box.label == self._header.goal else (90, 130, 200) for box in boxes],
            )
        self._has_boxes = bool(boxes)

    def _decision(self, entry: StepEntry) -> None:
        diagnostics = entry.decision.diagnostics
        numbers = {f"p({name})": value for name, value in diagnostics.probabilities.items()} | dict(diagnostics.scalars)
        if numbers and not self._with_scores:
            self._with_scores = True
            if self._with_layout:
                send_layout(self._log.stream, self._header, with_scores=True)
        for name, value in numbers.items():
            self._log.log(f"decision/scores/{rr.escape_entity_path_part(name)}", rr.Scalars, scalars=[float(value)])
        self._log_text("decision/text", _decision_text(entry))

    def _status_text(self, entry: StepEntry, distance_m: float | None) -> str:
        header = self._header
        action = entry.decision.action.value
        raw = "" if entry.decision.raw_action == action else f" (model: {entry.decision.raw_action})"
        distance = (
            "" if distance_m is None else f" · {distance_text(distance_m, header.parameters.success_distance_m)} m away"
        )
        return (
            f"### Looking for: {header.goal}{distance}\n"
            f"{action_count(header.parameters, entry.step)}: **{action}**{raw} — {_outcome(entry)}"
        )

    def _event(self, entry: EventEntry) -> None:
        self._set_time(entry.step, None)
        level = rr.TextLogLevel.WARN if entry.kind in WARNING_KINDS else rr.TextLogLevel.INFO
        author = f", by {entry.author}" if entry.author else ""
        self._log.stream.log("events", rr.TextLog(f"{entry.kind}: {entry.text}{author}", level=level))

    def _end(self, entry: EpisodeEnd) -> None:
        # One step after the last action, so that this action has a width in the lanes.
        self._set_time(entry.actions + 1, self._until_s)
        for lane in ("actions/action", "actions/outcome"):
            self._log.log(lane, rr.StateChange, state=[None])
        self._plan.draw_end(entry.verdict)
        failed = entry.verdict.success is False
        self._log.stream.log(
            "events",
            rr.TextLog(
                entry.verdict.text, level="WARN" if failed else "INFO", color=FAILURE_RGB if failed else SUCCESS_RGB
            ),
        )
        self._log.stream.log("verdict", _markdown(self._verdict_text(entry)), static=True)

    def _verdict_text(self, entry: EpisodeEnd) -> str:
        header, verdict = self._header, entry.verdict
        word = {True: "Success", False: "Failure", None: "Void"}[verdict.success]
        rows = [
            ("model", header.model),
            ("robot", header.robot),
            ("start", f"{header.start_number} of {header.site.title or header.site.name}"),
            ("end", verdict.end_reason.value.replace("_", " ")),
        ]
        if verdict.distance is not None:
            goal = verdict.distance
            distance = distance_text(goal.distance_m, header.parameters.success_distance_m, 3)
            rows.append(("distance", f"{distance} m from {goal.instance} ({goal.source.value})"))
        rows.append(("actions", f"{entry.actions}: {self._counts_text()}"))
        if entry.path_m is not None:
            rows.append(("path", f"{entry.path_m:.2f} m"))
        if entry.duration_s is not None:
            rows.append(("duration", f"{entry.duration_s:.1f} s of the robot's time"))
        if entry.error:
            rows.append(("error", entry.error))
        return f"# {word}: {header.goal}\n\n{verdict.text}\n\n" + _table([("episode", str(header.episode_id)), *rows])

    def _counts_text(self) -> str:
        parts = [f"{count} {name.lower().replace('_', ' ')}" for name, count in self._counts.most_common()]
        return ", ".join([*parts, f"{self._blocked} blocked"] if self._blocked else parts)


def _draw_curves(entities: StaticEntities, limit_m: float) -> None:
    """Log the style of the action lanes and of the distance curves."""
    for entity, colors in (
        ("action", {action.value: rgba for action, rgba in ACTION_RGBA.items()}),
        ("outcome", OUTCOME_RGBA),
    ):
        entities.log(
            f"actions/{entity}",
            rr.StateConfiguration(
                values=list(colors),
                labels=[value.replace("_", " ").lower() for value in colors],
                colors=np.array(list(colors.values()), np.uint32),
            ),
            static=True,
        )
    entities.log(
        "distance/to_goal",
        rr.SeriesLines(names="to the nearest instance", colors=[40, 100, 200], widths=2),
        static=True,
    )
    limit = f"success under {limit_m:g} m"
    entities.log("distance/success_under", rr.SeriesLines(names=limit, colors=SUCCESS_RGB, widths=1), static=True)


def action_count(parameters: ProtocolParameters, step: StepRecord) -> str:
    """Return which action of how many a step is, or which answer at which time."""
    if parameters.action_limit is not None:
        return f"action {step.number} of {parameters.action_limit}"
    time = "" if step.stamp_s is None else f", {step.stamp_s:.1f} s of {parameters.time_limit_s:g} s"
    return f"answer {step.number}{time}"


def _outcome(entry: StepEntry) -> str:
    if entry.step.blocked:
        return "blocked"
    if entry.step.result is not None and entry.step.result.collision is not None:
        return "collision"
    if entry.step.result is not None and not entry.step.result.completed:
        return "failed"
    return "stopped" if entry.decision.action is Action.STOP else "moved"


def _running_text(header: EpisodeHeader) -> str:
    rows = [("episode", str(header.episode_id)), ("model", header.model), ("robot", header.robot)]
    return f"# Running: {header.goal}\n\n" + _table([*rows, ("start", str(header.start_number))])


def _decision_text(entry: StepEntry) -> str:
    diagnostics = entry.decision.diagnostics
    infer_s = entry.step.timings.infer_s
    lines = [f"**{entry.decision.raw_action}**" + (f" in {infer_s * 1e3:.0f} ms" if infer_s is not None else "")]
    if entry.step.movement is not None:
        lines.append(entry.step.movement.text)
    if (answer := entry.step.answer) is not None:
        stale = " and was dropped as stale" if answer.stale else ""
        waiting_s = (entry.step.result.waiting_s if entry.step.result else None) or 0.0
        lines.append(f"{answer.age_s:.2f} s old when it took effect{stale}; {waiting_s:.2f} s of waiting")
    if diagnostics.note:
        lines.append(diagnostics.note)
    if diagnostics.probabilities:
        lines.append(_table([(name, f"{p:.3f}", "█" * round(p * 16)) for name, p in diagnostics.probabilities.items()]))
    if diagnostics.scalars:
        lines.append(_table([(name, f"{value:.4g}") for name, value in diagnostics.scalars.items()]))
    return "\n\n".join(lines)


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    """Return a Markdown table. The first row becomes the heading that Markdown requires."""
    lines = [f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows]
    return "\n".join([lines[0], "|" + " --- |" * len(rows[0]), *lines[1:]])


def _markdown(text: str) -> rr.TextDocument:
    return rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
