"""The state of a session as JSON for the page. It is complete, so that a reloaded page loses nothing."""

from datetime import UTC, datetime
from typing import Any, Final

from vsnbench.models.human.controls import Phase
from vsnbench.protocol.judge import GoalDistance
from vsnbench.protocol.stop_pose import range_text
from vsnbench.runner.judging.case import Case
from vsnbench.runner.judging.corrections import ShownEpisode
from vsnbench.runner.loop.contract import Session
from vsnbench.runner.operator.contract import Upcoming
from vsnbench.runner.operator.prompts import OperatorPrompts, QuestionKind
from vsnbench.runner.operator.session_state import SessionState
from vsnbench.sites.targets import goal_words, targets_of
from vsnbench.text.distances import distance_text
from vsnbench.values.pose import Pose

MAX_STEPS: Final = 400


def session_json(prompts: OperatorPrompts, session: Session) -> dict[str, Any]:
    """Return the state, which is the same for every client."""
    state, question, controls = prompts.state, prompts.question, session.robots.controls
    now = datetime.now(UTC)
    ended = state.ended
    is_judging = question is not None and question.kind is QuestionKind.JUDGE
    is_open = question is not None and question.answer is None
    return {
        "now": now.isoformat(),
        "label": session.label,
        "trials": session.trials.total,
        "done": state.done,
        "paused_by": prompts.paused_by,
        "ended_by": prompts.ended_by,
        "question": {"number": question.number, "kind": question.kind.value, "problem": question.problem}
        if question is not None and is_open
        else None,
        "trial": _trial_json(state.upcoming) if state.upcoming else None,
        "placing": _placing_json(state),
        "driving": prompts.driving,
        "waits_for": "" if controls is None or controls.view.phase is not Phase.READY else controls.driver,
        "elapsed_s": (now - state.began_at).total_seconds() if state.began_at else None,
        "actions": len(state.steps),
        "time_s": round(state.spent.time_s, 1),
        "path_m": round(state.spent.path_m, 2),
        "steps": [[step.action, step.blocked] for step in state.steps[-MAX_STEPS:]],
        "path": [_pose_json(step.pose) for step in state.steps],
        "left_at": _pose_json(state.left_at) if state.left_at else None,
        "route": state.way,
        "can_measure": state.measures_on_the_way,
        "can_declare": state.can_declare,
        "whereabouts": state.whereabouts,
        "revision": prompts.changes,
        "picture": state.pictures,
        "has_live_camera": session.robots.preview is not None,
        "case": case_json(Case.of_ended(ended)) if is_judging and ended else None,
        "last": {
            "episode": ended.number,
            "verdict": ended.outcome.verdict.text,
            "is_void": not ended.outcome.verdict.end_reason.is_result,
        }
        if ended
        else None,
    }


def _trial_json(upcoming: Upcoming) -> dict[str, Any]:
    plan = upcoming.plan
    return {
        "episode": upcoming.number,
        "driven_by": upcoming.driven_by,
        "goal": plan.goal,
        "goal_words": goal_words(plan.site, plan.goal),
        "targets": [target.id for target in targets_of(plan.site, plan.goal)],
        "start": plan.start.number,
        "pose": _pose_json(plan.start.pose),
        "heading_deg": plan.start.heading_deg,
        "note": plan.start.note,
        "max_actions": plan.parameters.max_actions,
        "max_time_s": plan.parameters.max_time_s,
        "max_path_m": plan.parameters.max_path_m,
    }


def _placing_json(state: SessionState) -> dict[str, Any]:
    look = state.look
    measured = look.measured if look is not None else None
    arrows = measured.arrows if measured and measured.advice and not measured.wants_turn else ()
    return {
        "can_measure": state.can_measure,
        "in_progress": state.looking,
        "is_measured": look is not None,
        "key": 0 if look is None else id(look),
        "problem": look.problem if look is not None else "",
        "headline": measured.headline if measured else "",
        "advice": measured.advice if measured else "",
        "differs": measured.differs if measured else "",
        "within_tolerance": measured.within_tolerance if measured else False,
        "needs_turn": measured.wants_turn if measured else False,
        "matches_site": measured.fits if measured else False,
        "arrows": [[arrow.direction.value, arrow.text] for arrow in arrows],
        "pose": _pose_json(measured.pose) if measured and measured.determined else None,
        "has_image": look is not None and look.rgb is not None,
        "has_photo": look is not None and look.photo_jpeg is not None,
    }


def _pose_json(pose: Pose) -> list[float]:
    return [round(pose.x_m, 3), round(pose.y_m, 3), round(pose.heading_rad, 4)]


def case_json(case: Case) -> dict[str, Any]:
    """Return what an operator needs to judge an episode."""
    estimate, success_m = case.estimate, case.parameters.success_distance_m
    return {
        "episode": case.number,
        "goal": case.goal,
        "measured_to": case.measured_to or f"nearest {case.goal}",
        "start": case.start,
        "ended_with": case.ended_with.value,
        "actions": case.actions,
        "estimate_m": distance_text(estimate.distance_m, success_m) if estimate else None,
        "in_sight": estimate.in_sight if estimate else None,
        "estimate": _range_json(estimate, success_m),
        "odometry": _range_json(case.odometry, success_m),
        "proposal": case.proposal.text if case.proposal else "",
        "success_m": success_m,
    }


def _range_json(distance: GoalDistance | None, success_m: float) -> str:
    """Return a distance with its range, if it is known; empty otherwise."""
    return "" if distance is None or distance.range_m is None else range_text(distance, success_m)


def episode_json(shown: ShownEpisode) -> dict[str, Any]:
    """Return a finished episode for the list."""
    episode = shown.episode
    return {
        "episode": episode.id,
        "driven_by": episode.model,
        "goal": episode.goal,
        "start": episode.start,
        "outcome": episode.outcome,
        "author": shown.author,
        "verdict": shown.verdict_text,
        "seen": shown.verdicts,
        "undo_s": round(shown.undo_s, 1),
        "case": case_json(shown.case),
        "can_be_judged": shown.case.ended_with.is_result or episode.outcome != "void",
    }
