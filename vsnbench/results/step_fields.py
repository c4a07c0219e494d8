"""The quantities of a step; each is declared once, here (`vsnbench.results.fields`)."""

from collections.abc import Callable
from datetime import datetime
from operator import attrgetter
from typing import Any

from vsnbench.results.fields import Field, Fields
from vsnbench.results.schema import tables
from vsnbench.results.schema.row_encoding import number
from vsnbench.values.fix import Fix
from vsnbench.values.motion_result import NOT_BEGUN
from vsnbench.values.movement import Movement
from vsnbench.values.pose import Pose
from vsnbench.values.step import StepRecord


def _result(name: str) -> Callable[[StepRecord], Any]:
    return lambda step: getattr(step.result or NOT_BEGUN, name)


def _measured(name: str) -> Callable[[StepRecord], float | None]:
    return lambda step: number(getattr(step.result or NOT_BEGUN, name))


def _of_collision(name: str) -> Callable[[StepRecord], Any]:
    return lambda step: getattr(step.result.collision, name) if step.result and step.result.collision else None


def _of_answer(name: str) -> Callable[[StepRecord], Any]:
    return lambda step: getattr(step.answer, name) if step.answer else None


_AT_REST = "where the robot rests while the model thinks"


def _step(name: str, kind: Any, meaning: str, get: Callable[[StepRecord], Any] | None = None, **how: Any) -> Field:
    columns = tables.StepRow.__table__.c
    sql = (columns[name],) if name in columns else ()
    return Field(name, kind, meaning, sql, get=get or attrgetter(name), **how)


STEP = Fields(
    (
        _step("number", int, "number of the step, from 1; STOP and blocked actions count", column="step"),
        _step("raw_action", str, "action as the model named it", is_hidden=True),
        _step("action", str, "action that the robot received"),
        _step("blocked", bool, "the depth guard prevented or ended it"),
        _step("completed", bool, "the robot completed it within its tolerances", _result("completed")),
        _step("refusal", str, "why the depth guard refused it or ended it early; empty otherwise"),
        _step("failure", str, "why the robot did not complete it; empty otherwise", _result("failure")),
        _step(
            "recorded_at",
            datetime | None,
            "time of writing",
            absent="for an arm of a blinded study",
            is_hidden=True,
        ),
        _step(
            "stamp_s",
            float | None,
            "time of the image on the robot's clock; of a blinded arm, the sum of the motions before it",
            is_hidden=True,
        ),
        _step("observed", Pose | None, "odometry at the observation, relative to the start"),
        _step("after", Pose | None, "odometry after the motion, relative to the start"),
        _step("world", Fix | None, "pose after the motion in the site's frame"),
        _step(
            "displacement_m",
            float | None,
            "distance driven by odometry, negative backwards",
            _measured("displacement_m"),
        ),
        _step("turn_rad", float | None, "angle turned by odometry, counter-clockwise", _measured("turn_rad")),
        _step("duration_s", float | None, "duration on the robot's clock", _measured("duration_s")),
        _step("corrections", int, "number of corrections at the end of the motion", _result("corrections")),
        _step(
            "collision_source",
            str | None,
            "`contact` (simulated) or `bumper`",
            _of_collision("source"),
            absent="without a collision",
        ),
        _step(
            "collision_touched",
            str | None,
            "id of the touched object, empty if unknown",
            _of_collision("touched"),
            absent="without a collision",
        ),
        _step("rgb_digest", str | None, "digest of the pixels of the colour image", absent="without one"),
        _step("depth_digest", str | None, "digest of the depth in millimetres", absent="without depth"),
        _step("rgb_file_digest", str | None, "digest of the file of the colour image", absent="without a file"),
        _step("depth_file_digest", str | None, "digest of the file of the depth image", absent="without a file"),
        _step("sense_s", float | None, "wall time to get the images", attrgetter("timings.sense_s"), is_hidden=True),
        _step("infer_s", float | None, "wall time of the model", attrgetter("timings.infer_s"), is_hidden=True),
        _step("move_s", float | None, "wall time of the motion", attrgetter("timings.move_s"), is_hidden=True),
        _step(
            "movement",
            Movement | None,
            "movement that the model asked for, in the robot's frame at the observation",
            lambda step: step.movement.to_json() if step.movement else None,
            absent="for a discrete action",
        ),
        _step(
            "path_m",
            float | None,
            "length of the driven path by odometry",
            _measured("path_m"),
            absent="where it is `displacement_m`",
        ),
        _step(
            "part",
            tuple[int, int] | None,
            "part of a chunk: its number from 1, and the number of parts",
            absent="outside of chunks",
        ),
        *(
            _step(name, kind, meaning, _of_answer(name), absent=_AT_REST, is_hidden=True)
            for name, kind, meaning in (
                ("answered_s", float | None, "time of the answer on the robot's clock"),
                ("age_s", float | None, "time from the capture of the image to the effect of the answer"),
                ("until_s", float | None, "time when the next answer took effect, or of rest at the end"),
                ("stale", bool | None, "the answer was dropped as too old"),
            )
        ),
        _step(
            "waiting_s",
            float | None,
            "time at rest without a path, waiting for an answer",
            _measured("waiting_s"),
            absent=_AT_REST,
            is_hidden=True,
        ),
        _step("probabilities", dict[str, float], "action → probability; empty if the model gives none", is_hidden=True),
        _step("details", dict[str, Any], "notes of the model and the sensors; keys depend on them", is_hidden=True),
    )
)
