"""What of an episode goes to which Rerun entity, entry by entry.

Entities: `camera/rgb` (with `detections`), `camera/depth`, `plan/**`, `actions/**` (state lanes), `distance/**`,
`decision/**`, `status`, `events`, `verdict`. Timelines: `step` (the action's number) and `robot_time`.
"""

import collections
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Box
from vsnbench.record.entries import EndEntry, Entry, EpisodeHeader, EventEntry, StepEntry
from vsnbench.viewer.blueprint import send_layout
from vsnbench.viewer.entity_log import EntityLog
from vsnbench.viewer.plan_layer import FAILURE_RGB, SUCCESS_RGB, FloorPlan
from vsnbench.viewer.still_entities import StillEntities, still_entities

if TYPE_CHECKING:
    import rerun as rr

ACTION_RGBA = {
    Action.MOVE_FORWARD: 0x3C8DD9FF,
    Action.TURN_LEFT: 0xF2A93BFF,
    Action.TURN_RIGHT: 0x8E6FC1FF,
    Action.MOVE_BACKWARD: 0x5FB3A8FF,
    Action.STOP: 0xD43F3AFF,
}
OUTCOME_RGBA = {
    "moved": 0x9CCC9CFF,
    "stopped": 0xB8B8B8FF,
    "blocked": 0xE0B040FF,
    "collision": 0xCE2C28FF,
    "failed": 0x7A1F1BFF,
}
ALARMING = frozenset(
    {"collision", "motion_failed", "sensor_lost", "model_error", "model_lost", "aborted", "interrupted"}
)
DEPTH_UNITS_PER_METRE = 1000.0


class EpisodeDrawing:
    """Logs the entries of one episode in their order."""

    def __init__(self, log: EntityLog, header: EpisodeHeader) -> None:
        self._log = log
        self._header = header
        self._plan = FloorPlan(log, header)
        self._counts: collections.Counter[str] = collections.Counter()
        self._blocked = 0
        self._first_stamp_s: float | None = None
        self._with_scores = False
        self._boxes_shown = False
        self._begin()

    def draw(self, entry: Entry) -> None:
        """Log one entry."""
        match entry:
            case StepEntry():
                self._step(entry)
            case EventEntry():
                self._event(entry)
            case EndEntry():
                self._end(entry)

    def _begin(self) -> None:
        header, recording = self._header, self._log.stream
        recording.send_recording_name(
            f"episode {header.episode_id}: {header.model}, {header.goal}, start {header.start_number}"
        )
        send_layout(recording, header, with_scores=False)
        self._plan.draw_site()
        limit_m = header.parameters.success_distance_m
        still_entities(("curves", limit_m), lambda entities: _draw_curves(entities, limit_m)).send(recording)
        self._set_time(0, None)
        recording.log("verdict", _markdown(_running_text(header)))

    def finish(self) -> None:
        """Hand over what is still held back."""
        self._log.send()

    def _set_time(self, step: int, stamp_s: float | None) -> None:
        if stamp_s is not None and self._first_stamp_s is None:
            self._first_stamp_s = stamp_s
        first_s = self._first_stamp_s
        self._log.at(step, None if stamp_s is None or first_s is None else stamp_s - first_s)

    def _step(self, entry: StepEntry) -> None:
        import rerun as rr

        put = self._log.put
        stamp_s = entry.step.stamp_s
        self._set_time(entry.step.number, float(entry.step.number) if stamp_s is None else stamp_s)
        diagnostics = entry.decision.diagnostics
        self._counts[entry.decision.action.value] += 1
        self._blocked += entry.step.blocked
        if entry.rgb_jpeg is not None:
            put("camera/rgb", rr.EncodedImage, blob=[entry.rgb_jpeg], media_type=["image/jpeg"])
        self._detections(diagnostics.boxes)
        if entry.depth_png is not None:
            put(
                "camera/depth",
                rr.EncodedDepthImage,
                blob=[entry.depth_png],
                media_type=["image/png"],
                meter=[DEPTH_UNITS_PER_METRE],
                depth_range=[[0, 6000]],
            )
        put("actions/action", rr.StateChange, state=[entry.decision.action.value])
        put("actions/outcome", rr.StateChange, state=[_outcome(entry)])
        distance = self._plan.draw_step(entry)
        if distance is not None:
            put("distance/to_goal", rr.Scalars, scalars=[distance])
            put("distance/success_under", rr.Scalars, scalars=[self._header.parameters.success_distance_m])
        self._decision(entry)
        self._say("status", self._status_text(entry, distance))

    def _say(self, entity: str, text: str) -> None:
        import rerun as rr

        self._log.put(entity, rr.TextDocument, text=[text], media_type=[rr.MediaType.MARKDOWN])

    def _detections(self, boxes: tuple[Box, ...]) -> None:
        import rerun as rr

        if boxes or self._boxes_shown:
            self._log.put(
                "camera/rgb/detections",
                rr.Boxes2D,
                centers=[((box.left + box.right) / 2, (box.top + box.bottom) / 2) for box in boxes],
                half_sizes=[((box.right - box.left) / 2, (box.bottom - box.top) / 2) for box in boxes],
                labels=[f"{box.label} {box.score:.2f}" for box in boxes],
                colors=[SUCCESS_RGB if box.label == self._header.goal else (90, 130, 200) for box in boxes],
            )
        self._boxes_shown = bool(boxes)

    def _decision(self, entry: StepEntry) -> None:
        import rerun as rr

        diagnostics = entry.decision.diagnostics
        numbers = {f"p({name})": value for name, value in diagnostics.probabilities.items()} | dict(diagnostics.scalars)
        if numbers and not self._with_scores:
            self._with_scores = True
            send_layout(self._log.stream, self._header, with_scores=True)
        for name, value in numbers.items():
            self._log.put(f"decision/scores/{rr.escape_entity_path_part(name)}", rr.Scalars, scalars=[float(value)])
        self._say("decision/text", _decision_text(entry))

    def _status_text(self, entry: StepEntry, distance_m: float | None) -> str:
        header = self._header
        action = entry.decision.action.value
        said = "" if entry.decision.raw_action == action else f" (model: {entry.decision.raw_action})"
        far = "" if distance_m is None else f" · {distance_m:.2f} m away"
        return (
            f"### Looking for: {header.goal}{far}\n"
            f"action {entry.step.number} of {header.parameters.max_actions}: **{action}**{said} — {_outcome(entry)}"
        )

    def _event(self, entry: EventEntry) -> None:
        import rerun as rr

        self._set_time(entry.step, None)
        level = rr.TextLogLevel.WARN if entry.kind in ALARMING else rr.TextLogLevel.INFO
        who = f", by {entry.author}" if entry.author else ""
        self._log.stream.log("events", rr.TextLog(f"{entry.kind}: {entry.text}{who}", level=level))

    def _end(self, entry: EndEntry) -> None:
        import rerun as rr

        # One past the last action: that one gets its width in the lanes, and the plan shows where it ended.
        self._set_time(entry.actions + 1, None)
        for lane in ("actions/action", "actions/outcome"):
            self._log.put(lane, rr.StateChange, state=[None])
        self._plan.draw_end(entry.verdict)
        failed = entry.verdict.success is False
        self._log.stream.log(
            "events",
            rr.TextLog(
                entry.verdict.text, level="WARN" if failed else "INFO", color=FAILURE_RGB if failed else SUCCESS_RGB
            ),
        )
        self._log.stream.log("verdict", _markdown(self._verdict_text(entry)), static=True)

    def _verdict_text(self, entry: EndEntry) -> str:
        header, verdict = self._header, entry.verdict
        word = {True: "Success", False: "Failure", None: "Void"}[verdict.success]
        rows = [
            ("model", header.model),
            ("robot", header.robot),
            ("start", f"{header.start_number} of {header.site.title or header.site.name}"),
            ("end", verdict.end_reason.value.replace("_", " ")),
        ]
        if verdict.distance is not None:
            near = verdict.distance
            rows.append(("distance", f"{near.distance_m:.3f} m from {near.instance} ({near.source.value})"))
        rows.append(("actions", f"{entry.actions}: {self._counted()}"))
        if entry.path_length_m is not None:
            rows.append(("path", f"{entry.path_length_m:.2f} m"))
        if entry.duration_s is not None:
            rows.append(("duration", f"{entry.duration_s:.1f} s of the robot's time"))
        if entry.error:
            rows.append(("error", entry.error))
        return f"# {word}: {header.goal}\n\n{verdict.text}\n\n" + _table([("episode", str(header.episode_id)), *rows])

    def _counted(self) -> str:
        counted = [f"{count} {name.lower().replace('_', ' ')}" for name, count in self._counts.most_common()]
        return ", ".join([*counted, f"{self._blocked} blocked"] if self._blocked else counted)


def _draw_curves(entities: StillEntities, limit_m: float) -> None:
    """Log how the lanes of actions and the curves of the distance look."""
    import rerun as rr

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
    if diagnostics.note:
        lines.append(diagnostics.note)
    if diagnostics.probabilities:
        lines.append(_table([(name, f"{p:.3f}", "█" * round(p * 16)) for name, p in diagnostics.probabilities.items()]))
    if diagnostics.scalars:
        lines.append(_table([(name, f"{value:.4g}") for name, value in diagnostics.scalars.items()]))
    return "\n\n".join(lines)


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    """Return a Markdown table; its first row serves as the heading that Markdown insists on."""
    lines = [f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows]
    return "\n".join([lines[0], "|" + " --- |" * len(rows[0]), *lines[1:]])


def _markdown(text: str) -> "rr.TextDocument":
    import rerun as rr

    return rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
