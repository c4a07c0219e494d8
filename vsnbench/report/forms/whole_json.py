"""Everything that a report knows as one JSON object: rates are shares of 0 to 1, what is unknown is null."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from vsnbench.report.activity import Activity, RobotActivity
from vsnbench.report.attended import Attended
from vsnbench.report.attended_tables import attended_fields
from vsnbench.report.comparison_tables import comparison_fields, contest_fields
from vsnbench.report.forms.plain import condition_fields, summary_fields
from vsnbench.report.forms.scrutiny_json import failure_fields, judgement_fields, scrutiny_fields, twin_fields
from vsnbench.report.question import Question
from vsnbench.report.record import Record
from vsnbench.report.summary import ConditionSummary, Results
from vsnbench.report.twins import twins


def to_json(
    results: Results,
    questions: Sequence[Question] = (),
    activity: Activity | None = None,
    record: Record | None = None,
    attended: Attended | None = None,
) -> str:
    """Return the results as one JSON object.

    `models`: each condition with its settings, protocol, campaigns and seeds, its `goals`, `total`, `starts`,
    `end_reasons`, `actions`, and what a reviewer asks: `scrutiny`, `failures`, `judgements`; `questions`: which model
    succeeds more often, with every comparison and all models at once; `twins`: real against simulated; `stability`: how
    far each robot drove; `attended`: who stood beside it and judged, null where it was one person in one session. What
    was not counted is null.
    """
    content = {
        "confidence": 0.95,
        "interval": "wilson, at the effective sample size of the starting positions",
        "models": [model_fields(one, activity, record) for one in results.conditions],
        "questions": [_question(one) for one in questions],
        "twins": [twin_fields(one) for one in twins(results)],
        "stability": [_robot(one) for one in activity.robots] if activity else None,
        "attended": attended_fields(attended),
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def model_fields(one: ConditionSummary, activity: Activity | None, record: Record | None) -> dict[str, Any]:
    """Return everything about one condition as JSON values.

    Args:
        one: its numbers.
        activity: where its actions, failures and judgements are; null without.
        record: where its episodes are; no scrutiny without, nor of the paper's.
    """
    condition, number = one.condition, one.condition.number
    counted = activity is not None and not condition.published
    failures = judgements = None
    if activity and counted:
        failures = next((each for each in activity.failures if each.condition == number), None)
        judgements = next((each for each in activity.judgements if each.condition == number), None)
    return {
        **condition_fields(condition),
        "campaigns": list(condition.campaigns),
        "seeds": list(condition.seeds),
        "differing": list(condition.differing),
        "settings": known(dict(condition.settings)),
        "protocol": known(dict(condition.protocol)),
        "conditions": known(dict(condition.conditions)),
        "goals": [{"goal": goal.goal, **summary_fields(goal.summary)} for goal in one.goals],
        "total": summary_fields(one.total),
        "shared_goals": list(one.shared_goals),
        "total_shared_goals": summary_fields(one.shared) if one.shared else None,
        "starts": [{"start": start.start, **summary_fields(start.summary)} for start in one.starts],
        "end_reasons": [
            {"end_reason": end.end_reason, "attempts": end.attempts, "counted": end.counted} for end in one.ends
        ],
        "actions": [
            {"raw_action": each.raw_action, "action": each.action, "blocked": each.blocked, "steps": each.steps}
            for each in activity.actions
            if each.condition == number
        ]
        if activity and counted
        else None,
        "scrutiny": scrutiny_fields(record, one) if record and not condition.published else None,
        "failures": failure_fields(failures),
        "judgements": judgement_fields(judgements),
    }


def _question(question: Question) -> dict[str, Any]:
    return {
        "where": question.where,
        "members": [one.condition.name for one in question.members],
        "answers": list(question.answers),
        "not_asked": list(question.not_asked),
        "contest": contest_fields(question.contest) if question.contest else None,
        "comparisons": [comparison_fields(one) for one in question.comparisons],
    }


def _robot(one: RobotActivity) -> dict[str, Any]:
    fields: dict[str, Any] = known({**asdict(one), "failures_per_km": one.failures_per_km})
    return fields


def known(value: Any) -> Any:
    """Return a value from the record with null for numbers that JSON has no word for."""
    if isinstance(value, dict):
        return {name: known(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [known(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
