"""What a page is told of a session, as JSON: everything on it comes from here, so that a reloaded page is whole."""

from datetime import UTC, datetime
from typing import Any

from vsnbench.protocol.pose import Pose
from vsnbench.runner.attendance import Occasion
from vsnbench.runner.case import Case
from vsnbench.runner.corrections import ShownEpisode
from vsnbench.runner.desk import Asks, Desk

STEPS_SHOWN = 400


def session_state(desk: Desk, occasion: Occasion) -> dict[str, Any]:
    """Return what everybody is shown alike."""
    board, question = desk.board, desk.question
    now = datetime.now(UTC)
    ended, upcoming = board.ended, board.upcoming
    judging = question is not None and question.asks is Asks.JUDGE
    return {
        "now": now.isoformat(),
        "label": occasion.label,
        "blind": occasion.blind,
        "real": occasion.needs_a_person,
        "trials": occasion.trials,
        "done": board.done,
        "paused_by": desk.paused_by,
        "ended_by": desk.ended_by,
        "question": None
        if question is None or question.reply is not None
        else {"number": question.number, "asks": question.asks.value, "problem": question.problem},
        "trial": None
        if upcoming is None
        else {
            "episode": upcoming.number,
            "driven_by": upcoming.driven_by,
            "goal": upcoming.plan.goal,
            "start": upcoming.plan.start.number,
            "pose": _pose(upcoming.plan.start.pose),
            "heading_deg": upcoming.plan.start.heading_deg,
            "note": upcoming.plan.start.note,
            "most_actions": upcoming.plan.parameters.max_actions,
        },
        "placing": _placing(desk),
        "driving": desk.driving,
        "for_s": (now - board.began_at).total_seconds() if board.began_at else None,
        "actions": len(board.steps),
        "steps": [[step.action, step.blocked] for step in board.steps[-STEPS_SHOWN:]],
        "course": [_pose(step.pose) for step in board.steps],
        "left_at": _pose(board.left_at) if board.left_at else None,
        "way": board.way,
        "record": desk.changes,
        "picture": board.picture.number if board.picture else 0,
        "live": occasion.glimpse is not None,
        "case": case_shown(Case.of_ended(ended)) if judging and ended else None,
        "last": None
        if ended is None
        else {
            "episode": ended.number,
            "words": ended.outcome.verdict.text,
            "void": not ended.outcome.verdict.end_reason.is_result,
        },
    }


def _placing(desk: Desk) -> dict[str, Any]:
    board = desk.board
    look = board.look
    measured = look.measured if look is not None else None
    return {
        "can_measure": board.can_measure,
        "looking": board.looking,
        "seen": look is not None,
        "key": 0 if look is None else id(look),
        "problem": look.problem if look is not None else "",
        "headline": measured.headline if measured else "",
        "advice": measured.advice if measured else "",
        "differs": measured.differs if measured else "",
        "green": measured.within_tolerance if measured else False,
        "determined": measured.determined if measured else False,
        "wants_turn": measured.wants_turn if measured else False,
        "seen_near": measured.fits if measured else False,
        "arrows": [[arrow.direction.value, arrow.words] for arrow in measured.arrows]
        if measured and measured.advice and not measured.wants_turn
        else [],
        "stands": _pose(measured.pose) if measured and measured.determined else None,
        "picture": look is not None and look.rgb is not None,
        "photo": look is not None and look.photo_jpeg is not None,
    }


def _pose(pose: Pose) -> list[float]:
    return [round(pose.x_m, 3), round(pose.y_m, 3), round(pose.heading_rad, 4)]


def case_shown(case: Case) -> dict[str, Any]:
    """Return what a person needs to judge an episode."""
    estimate = case.robots_estimate
    return {
        "episode": case.number,
        "ended_with": case.ended_with.value,
        "actions": case.actions,
        "estimate_m": round(estimate.distance_m, 2) if estimate else None,
        "in_sight": estimate.in_sight if estimate else None,
        "proposal": case.proposal.text if case.proposal else "",
        "success": case.proposal.success if case.proposal else None,
        "success_m": case.parameters.success_distance_m,
    }


def episode_shown(one: ShownEpisode) -> dict[str, Any]:
    """Return an episode that has ended, as the list shows it."""
    episode = one.summary
    return {
        "episode": episode.id,
        "driven_by": episode.model,
        "goal": episode.goal,
        "start": episode.start,
        "outcome": episode.outcome,
        "author": one.author,
        "words": one.words,
        "seen": one.verdicts,
        "undo_s": round(one.undo_s, 1),
        "case": case_shown(one.case),
        "can_be_judged": one.case.ended_with.is_result or episode.outcome != "void",
    }
