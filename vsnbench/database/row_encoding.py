"""Turns what a writer hands over into the columns of the tables, and the columns of a step back into it."""

import math
from datetime import UTC, datetime
from typing import Any

from vsnbench.database.campaign_plan import CampaignPlan, ModelIdentity
from vsnbench.database.episode_entries import EpisodeBegin, EpisodeEnd
from vsnbench.database.provenance import Provenance
from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.judge import Verdict
from vsnbench.protocol.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_identity import RobotIdentity
from vsnbench.protocol.site import Site
from vsnbench.protocol.step_record import StepRecord, StepTimings

Row = dict[str, Any]
"""Column name -> value."""


def number(value: float | None) -> float | None:
    """Return the number as the record keeps it: NULL for what is not finite."""
    return None if value is None or not math.isfinite(value) else float(value)


def _known(value: float | None) -> float:
    return math.nan if value is None else value


def text(value: str) -> str:
    """Return text that every database takes: no NUL characters, no lone surrogates."""
    return value.replace("\x00", "\N{REPLACEMENT CHARACTER}").encode("utf-8", "replace").decode("utf-8")


def pose_columns(prefix: str, pose: Pose | None) -> Row:
    """Return `<prefix>_x_m`, `_y_m` and `_heading_rad`."""
    return {
        f"{prefix}_x_m": pose.x_m if pose else None,
        f"{prefix}_y_m": pose.y_m if pose else None,
        f"{prefix}_heading_rad": pose.heading_rad if pose else None,
    }


def pose_of_columns(x_m: float | None, y_m: float | None, heading_rad: float | None) -> Pose | None:
    """Return the pose of three columns; None unless all of it is known."""
    return None if x_m is None or y_m is None or heading_rad is None else Pose(x_m, y_m, heading_rad)


def fix_of_columns(x_m: float | None, y_m: float | None, heading_rad: float | None, source: str | None) -> Fix | None:
    """Return the pose of three columns, and how it is known; None unless all of it is."""
    pose = pose_of_columns(x_m, y_m, heading_rad)
    return None if pose is None or source is None else Fix(pose, PoseSource(source))


def process_row(given: Provenance) -> Row:
    """Return the row of a writing process."""
    return {
        "host": text(given.identity.host),
        "pid": given.identity.pid,
        "boot_id": given.identity.boot_id,
        "pid_namespace": given.identity.pid_namespace,
        "start_ticks": given.identity.start_ticks,
        "started_at": given.started_at,
        "operator": text(given.operator),
        "command": text(given.command),
        "vsnbench_version": given.vsnbench_version,
        "git_commit": given.git_commit,
        "git_dirty": given.git_dirty,
        "packages": dict(given.packages),
        "platform": dict(given.platform),
    }


def site_row(site: Site) -> Row:
    """Return the row of a site, whole."""
    return {"sha256": site.sha256, "name": site.name, "title": site.title, "content": site.content()}


def robot_row(robot: RobotIdentity) -> Row:
    """Return the row of a robot."""
    return {
        "sha256": robot.sha256,
        "kind": text(robot.kind),
        "name": robot.profile.name,
        "title": robot.profile.title,
        "simulated": robot.simulated,
        "profile": robot.profile.content(),
    }


def model_row(model: ModelIdentity) -> Row:
    """Return the row of a model."""
    return {
        "sha256": model.sha256,
        "name": text(model.name),
        "weights_sha256": model.weights_sha256,
        "weights_label": text(model.weights_label),
        "files": dict(model.files),
        "code": dict(model.code),
        "settings": dict(model.settings),
        "goals": None if model.goals is None else sorted(model.goals),
        "sensors": sorted(model.sensors),
        "surveyed": model.surveyed,
    }


def campaign_row(plan: CampaignPlan) -> Row:
    """Return the row of a campaign, without the rows that it points to."""
    return {
        "key": plan.key,
        "name": text(plan.name) or _campaign_name(plan),
        "created_at": datetime.now(UTC),
        "protocol": plan.protocol.model_dump(mode="json"),
        "protocol_sha256": plan.protocol_sha256,
        "conditions": dict(plan.conditions),
        "seed": plan.seed,
    }


def _campaign_name(plan: CampaignPlan) -> str:
    simulated = "simulated " if plan.robot.simulated else ""
    return f"{text(plan.model.name)} on {simulated}{plan.robot.profile.name} in {plan.site.name}"


def episode_begin_row(begin: EpisodeBegin) -> Row:
    """Return the columns that an episode's beginning fills in."""
    return {
        "started_at": begin.started_at or datetime.now(UTC),
        "geodesic_start_m": number(begin.geodesic_m),
        **({} if begin.has_images else {"images_directory": ""}),
    }


def placement_row(start: Fix) -> Row:
    """Return the columns that the placing of the robot fills in."""
    return {**pose_columns("start", start.pose), "start_source": start.source.value}


def step_row(episode_id: int, step: StepRecord) -> Row:
    """Return the row of a step; one that the guard refused ends where it began."""
    result = step.result
    collision = result.collision if result else None
    return {
        "episode_id": episode_id,
        "number": step.number,
        "raw_action": text(step.raw_action) or step.action.value,
        "action": step.action.value,
        "blocked": step.blocked,
        "completed": result is not None and result.completed,
        "failure": text(result.failure) if result else "",
        "recorded_at": step.recorded_at or datetime.now(UTC),
        "stamp_s": number(step.stamp_s),
        **pose_columns("observed", step.observed),
        **pose_columns("after", step.after),
        **pose_columns("world", step.world.pose if step.world else None),
        "world_source": step.world.source.value if step.world else None,
        "displacement_m": number(result.displacement_m) if result else 0.0,
        "turn_rad": number(result.turn_rad) if result else 0.0,
        "duration_s": number(result.duration_s) if result else 0.0,
        "corrections": result.corrections if result else 0,
        "collision_source": collision.source.value if collision else None,
        "collision_touched": text(collision.touched) if collision else None,
        "rgb_sha256": step.rgb_sha256,
        "depth_sha256": step.depth_sha256,
        "sense_s": number(step.timings.sense_s),
        "infer_s": number(step.timings.infer_s),
        "move_s": number(step.timings.move_s),
        "probabilities": dict(step.probabilities) or None,
        "details": dict(step.details) or None,
    }


def step_of_row(row: Any) -> StepRecord:
    """Return the step of a row, as it was handed to `step_row`.

    Raises:
        ValueError: the row holds what no step has.
    """
    result = None
    if not row.blocked:
        collision = None
        if row.collision_source is not None:
            collision = Collision(CollisionSource(row.collision_source), row.collision_touched or "")
        result = MotionResult(
            completed=row.completed,
            displacement_m=_known(row.displacement_m),
            turn_rad=_known(row.turn_rad),
            duration_s=_known(row.duration_s),
            collision=collision,
            failure=row.failure,
            corrections=row.corrections,
            pose=pose_of_columns(row.after_x_m, row.after_y_m, row.after_heading_rad),
        )
    return StepRecord(
        number=row.number,
        action=Action(row.action),
        raw_action=row.raw_action,
        result=result,
        observed=pose_of_columns(row.observed_x_m, row.observed_y_m, row.observed_heading_rad),
        stamp_s=row.stamp_s,
        world=fix_of_columns(row.world_x_m, row.world_y_m, row.world_heading_rad, row.world_source),
        rgb_sha256=row.rgb_sha256,
        depth_sha256=row.depth_sha256,
        timings=StepTimings(row.sense_s, row.infer_s, row.move_s),
        probabilities=row.probabilities or {},
        details=row.details or {},
        recorded_at=row.recorded_at,
    )


def episode_end_row(end: EpisodeEnd) -> Row:
    """Return the columns that an episode's end fills in."""
    distance = end.verdict.distance if end.verdict else None
    return {
        "ended_at": end.ended_at or datetime.now(UTC),
        "end_reason": end.end_reason.value,
        "error": text(end.error),
        "actions": end.actions,
        "path_length_m": number(end.path_length_m),
        "geodesic_end_m": number(end.geodesic_m),
        "duration_s": number(end.duration_s),
        "wall_duration_s": number(end.wall_duration_s),
        "distance_to_goal_m": number(distance.distance_m) if distance else None,
        "distance_source": distance.source.value if distance else None,
        "goal_instance": distance.instance if distance else None,
        "goal_in_sight": distance.in_sight if distance else None,
        **pose_columns("final", end.final.pose if end.final else None),
        "final_source": end.final.source.value if end.final else None,
    }


def verdict_row(
    episode_id: int, verdict: Verdict, *, author: str, source: str, note: str = "", proposed: bool = False
) -> Row:
    """Return the row of a verdict given now."""
    distance = verdict.distance
    return {
        "episode_id": episode_id,
        "created_at": datetime.now(UTC),
        "proposed": proposed,
        "success": verdict.success,
        "end_reason": verdict.end_reason.value,
        "distance_m": number(distance.distance_m) if distance else None,
        "distance_source": distance.source.value if distance else None,
        "goal_instance": distance.instance if distance else None,
        "goal_in_sight": distance.in_sight if distance else None,
        "author": text(author),
        "source": source,
        "reason": text(verdict.text),
        "note": text(note),
    }
