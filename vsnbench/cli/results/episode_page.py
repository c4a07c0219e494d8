"""Prints an episode to the terminal: its result, steps, verdicts and provenance."""

import math
from collections import Counter
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

from vsnbench.cli.support.terminal import COLORS, safe

if TYPE_CHECKING:
    from collections.abc import Mapping

    from vsnbench.report.analysis.courses import CourseMeasures
    from vsnbench.results.goals import RecordedGoal
    from vsnbench.results.model import EpisodeProvenance, EpisodeRecord
    from vsnbench.text.terminal import Console
    from vsnbench.values.step import StepRecord


def print_page(
    console: "Console",
    episode: "EpisodeRecord",
    steps: "tuple[StepRecord, ...]",
    measures: "CourseMeasures",
    directory: Path | None,
    *,
    every_step: bool,
) -> None:
    """Print an episode; `directory` holds its images, or is None without images."""
    from vsnbench.protocol.execution import STACK

    _print_summary(console, episode, measures, directory)
    if episode.execution == STACK:
        _print_looks(console, steps)
    else:
        _print_actions(console, steps)
    if every_step:
        _print_steps(console, steps)
    _print_judgement(console, episode)
    _print_provenance(console, episode)


def metres(value: float | None, success_distance_m: float | None = None) -> str:
    """Return a length in metres, or an empty string if unknown.

    A distance to the goal is rounded to its side of the success distance.
    """
    from vsnbench.text.distances import distance_text

    if value is None:
        return ""
    return f"{distance_text(value, success_distance_m)} m" if math.isfinite(value) else "unreachable"


def fixed(value: float, places: int, unit: str = "") -> str:
    """Return a number with a fixed number of places, without "-0"; an empty string if it is not finite."""
    return f"{value:z.{places}f}{unit}" if math.isfinite(value) else ""


def _course_rows(progress: float | None, measures: "CourseMeasures") -> list[tuple[str, str]]:
    """Return how far the robot came, and how; nothing of what is unknown."""
    parts = {
        "progress": "" if progress is None else f"{100 * progress:.0f} % of the shortest path",
        "oracle success": ""
        if measures.oracle_success is None
        else "STOP would have succeeded on the way"
        if measures.oracle_success
        else "STOP would have succeeded nowhere on the way",
        "furthest stage": measures.stage.value if measures.stage else "",
        "clearance": ""
        if measures.clearance_min_m is None
        else f"at least {measures.clearance_min_m:.2f} m, 5th percentile {measures.clearance_p5_m:.2f} m",
        "turning": ""
        if measures.heading_change_deg_per_m is None
        else f"{measures.heading_change_deg_per_m:.0f}° per metre",
    }
    return [(name, text) for name, text in parts.items() if text]


def _print_summary(
    console: "Console", episode: "EpisodeRecord", measures: "CourseMeasures", directory: Path | None
) -> None:
    from vsnbench.protocol.execution import STACK, STOP_AND_GO, text_of_execution

    color = COLORS[episode.outcome]
    note = "; it does not count for its trial" if episode.state in ("void", "superseded") else ""
    article = "a " if episode.goal_definition is None else ""
    console.print(
        f"[bold]Episode {episode.id}[/]: {safe(episode.model)} looks for {article}[bold]{safe(episode.goal)}[/] from "
        f"position {episode.start}, repetition {episode.repetition}: [{color}]{episode.outcome}[/]{note}"
    )
    source = f" ({episode.distance_source})" if episode.distance_source else ""
    rows = [
        *_goal_rows(episode.goal_definition),
        ("campaign", f"{episode.campaign_id}: {safe(episode.campaign)}"),
        (
            "robot, site",
            f"{'simulated' if episode.simulated else 'real'} {safe(episode.robot)} in {safe(episode.site)}",
        ),
        (
            "ended with",
            safe(episode.end_reason or "still running") + (f": {safe(episode.error)}" if episode.error else ""),
        ),
        *([("execution", text_of_execution(episode.provenance.protocol))] if episode.execution != STOP_AND_GO else []),
        *([] if episode.execution == STACK else [("actions", str(episode.actions))]),
        *((f"goal {leg.position}", safe(leg.text)) for leg in episode.legs),
        ("distance to goal", (metres(episode.distance_m, episode.success_distance_m) or "unknown") + source),
        *_course_rows(episode.progress, measures),
        (
            "path",
            f"{metres(episode.path_m) or 'unknown'} (shortest {metres(episode.shortest_m) or 'unknown'})",
        ),
        (
            "duration",
            _seconds(episode.duration_s) + f" of robot time, {_seconds(episode.wall_duration_s)} of wall time",
        ),
        ("started", f"{episode.started_at:%Y-%m-%d %H:%M:%S} UTC"),
        *_session_and_placement(episode),
        *([("tags", safe(", ".join(episode.tags)))] if episode.tags else []),
        ("seed", str(episode.seed)),
        ("uuid", episode.uuid),
        ("files", safe(directory) if directory else "none"),
    ]
    for name, value in rows:
        console.print(f"  {name:<17} {value}", soft_wrap=True)


def _goal_rows(goal: "RecordedGoal | None") -> "list[tuple[str, str]]":
    if goal is None:
        return []
    words = f": {safe(goal.text)}" if goal.text else ""
    return [("goal", f"{goal.kind}{words}"), ("targets", safe(goal.target_text))]


def _session_and_placement(episode: "EpisodeRecord") -> "list[tuple[str, str]]":
    rows = []
    if (session := episode.session) is not None:
        until = f"{session.ended_at:%H:%M} UTC" if session.ended_at else "now"
        reason = f": {safe(session.words)}" if session.words else ""
        rows.append(("session", f"{safe(session.operator)}, {session.began_at:%Y-%m-%d %H:%M} to {until}{reason}"))
    if (measured := episode.measured) is not None:
        by = f", accepted by {safe(measured.author)}" if measured.author else ""
        moved = f"; moved since the survey: {safe(', '.join(measured.moved))}" if measured.moved else ""
        rows.append(("placed", f"{safe(measured.words)}{by}{moved}"))
    if (stopped := episode.stopped) is not None:
        moved = f"; moved since the survey: {safe(', '.join(stopped.moved))}" if stopped.moved else ""
        rows.append(("stopped", f"{safe(stopped.words)}{moved}"))
    return rows


def _seconds(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.1f} s"


def _print_looks(console: "Console", steps: "tuple[StepRecord, ...]") -> None:
    """Print how often a stack was looked at, and what was taken as its STOP."""
    from vsnbench.values.movement import Action

    source = next((step.raw_action for step in steps if step.action is Action.STOP), "none")
    console.print(f"  {'looks':<17} {len(steps)}; STOP: {safe(source)}", soft_wrap=True)


def _print_actions(console: "Console", steps: "tuple[StepRecord, ...]") -> None:
    if not steps:
        return
    counts = Counter((step.raw_action, step.action) for step in steps)
    actions = ", ".join(
        f"{count} {safe(raw)}" + (f" as {action}" if raw != action else "")
        for (raw, action), count in counts.most_common()
    )
    blocked = sum(step.blocked for step in steps)
    console.print(
        f"  {'steps':<17} {actions}" + (f"; {blocked} blocked by the depth guard" if blocked else ""), soft_wrap=True
    )
    if answers := [step.answer for step in steps if step.answer is not None]:
        ages = sorted(answer.age_s for answer in answers)
        waited_s = sum(step.result.waiting_s or 0.0 for step in steps if step.result)
        stale = sum(answer.stale for answer in answers)
        console.print(
            f"  {'answers':<17} {ages[len(ages) // 2]:.2f} s old (median) when they took effect; "
            f"{waited_s:.1f} s of waiting" + (f"; {stale} dropped as stale" if stale else ""),
            soft_wrap=True,
        )
    inferred = sorted(step.timings.infer_s for step in steps if step.timings.infer_s is not None)
    if inferred:
        console.print(f"  {'inference':<17} {inferred[len(inferred) // 2] * 1000:.1f} ms (median)")
    for step in steps:
        if step.result and (touch := step.result.collision):
            touched = f" with {safe(touch.touched)}" if touch.touched else ""
            console.print(f"  {'collision':<17} at action {step.number}{touched} ({touch.source})")


def _print_steps(console: "Console", steps: "tuple[StepRecord, ...]") -> None:
    from rich.table import Table

    table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, 2, 0, 0))
    for name in ("step", "action", "moved", "turned", "x", "y", "heading", ""):
        table.add_column(name, justify="left" if name in ("action", "") else "right", no_wrap=bool(name))
    for step in steps:
        pose, result = step.world.pose if step.world else step.after, step.result
        note = (result.failure if result else "") or step.refusal or ("blocked" if step.blocked else "")
        if step.movement is not None:
            note = f"{step.movement.text}; {note}".removesuffix("; ")
        if step.answer is not None:
            note = f"{'stale ' if step.answer.stale else ''}at {step.answer.age_s:.2f} s; {note}".removesuffix("; ")
        if result and result.collision:
            note = f"collision {result.collision.touched}"
        table.add_row(
            str(step.number),
            safe(step.raw_action),
            fixed(result.displacement_m if result else 0.0, 3, " m"),
            fixed(degrees(result.turn_rad) if result else 0.0, 1, "°"),
            fixed(pose.x_m, 2) if pose else "",
            fixed(pose.y_m, 2) if pose else "",
            fixed(pose.heading_deg, 1, "°") if pose else "",
            safe(note),
        )
    console.print()
    console.print(table)


def _print_judgement(console: "Console", episode: "EpisodeRecord") -> None:
    console.print("\n[bold]Verdicts[/] (the last one counts)" if episode.verdicts else "\n[bold]No verdict yet[/]")
    for verdict in episode.verdicts:
        console.print(
            f"  {verdict.created_at:%Y-%m-%d %H:%M:%S}  {safe(verdict.reason)}  "
            f"[dim]({safe(verdict.author)}, {safe(verdict.source)})[/]",
            soft_wrap=True,
        )
    if episode.events:
        console.print("\n[bold]Events[/]")
    for event in episode.events:
        where = f"action {event.step_number}" if event.step_number else ""
        author = f" [dim]({safe(event.author)})[/]" if event.author else ""
        console.print(
            f"  {event.created_at:%Y-%m-%d %H:%M:%S}  {where:<11} {safe(event.kind)}: {safe(event.statement)}{author}",
            soft_wrap=True,
        )


def _identity_row(provenance: "EpisodeProvenance") -> tuple[str, str]:
    """Return what exactly the model was: its weights, or version, commit and file of a stack."""
    from vsnbench.protocol.execution import STACK

    if (file := provenance.model_files.get(STACK)) is None:
        return "weights", f"{provenance.weights_label} {provenance.weights_sha256[:12]}".strip() or "none"
    commit = provenance.model_code.get("commit", "")
    return "stack", f"{provenance.weights_label}{f', commit {commit}' if commit else ''}, file {file[:12]}"


def _print_provenance(console: "Console", episode: "EpisodeRecord") -> None:
    provenance = episode.provenance
    git = (
        f", commit {provenance.git_commit[:12]}{' with changes' if provenance.git_dirty else ''}"
        if provenance.git_commit
        else ""
    )
    console.print("\n[bold]Provenance[/] (--json has all of it)")
    rows = [
        ("vsnbench", f"{provenance.vsnbench_version}{git}, Python {provenance.platform.get('python', '')}"),
        ("machine", f"{provenance.host}, {provenance.platform.get('processor', '')}"),
        ("model ran on", _runs_on(provenance.platform)),
        ("operator", provenance.operator),
        _identity_row(provenance),
        ("settings", ", ".join(f"{name}={value}" for name, value in provenance.model_settings.items()) or "none"),
        ("site", provenance.site_sha256[:12]),
        ("protocol", provenance.protocol_sha256[:12]),
        ("conditions", ", ".join(f"{name}={value}" for name, value in provenance.conditions.items()) or "none"),
        ("command", provenance.command),
    ]
    for name, value in rows:
        console.print(f"  {name:<17} {safe(value)}", soft_wrap=True)


def _runs_on(platform: "Mapping[str, str]") -> str:
    """Return device, runtime and threads of the model, as far as they are recorded."""
    facts = {name.removeprefix("model_"): value for name, value in platform.items() if name.startswith("model_")}
    return ", ".join(f"{name} {value}" for name, value in facts.items()) or "unknown"
