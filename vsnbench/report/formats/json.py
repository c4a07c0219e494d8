"""The whole report as one JSON object: rates from 0 to 1, null if unknown."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, TypeVar

from vsnbench.report.analysis.activity import Activity, RobotActivity
from vsnbench.report.analysis.courses import CourseSummary
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.failures import Failures
from vsnbench.report.analysis.fields import condition_fields
from vsnbench.report.analysis.judgements import Judgements, RaterAgreement
from vsnbench.report.analysis.operators import OperatorActivity
from vsnbench.report.analysis.published import published
from vsnbench.report.analysis.summary import ConditionSummary, Results
from vsnbench.report.comparison.question import Question
from vsnbench.report.comparison.sim_vs_real import sim_real_pairs
from vsnbench.report.formats.sensitivity_json import (
    course_fields,
    failure_fields,
    judgement_fields,
    sensitivity_fields,
    sim_vs_real_fields,
)
from vsnbench.report.tables.activity import ENDS, end_counts
from vsnbench.report.tables.comparison import comparison_fields, ranking_fields
from vsnbench.report.tables.operators import operator_fields
from vsnbench.report.tables.second_judgements import second_judgement_fields
from vsnbench.report.tables.success import GROUP

_Counts = TypeVar("_Counts", Failures, Judgements, CourseSummary)


def to_json(
    results: Results,
    questions: Sequence[Question] = (),
    activity: Activity | None = None,
    record: ReportData | None = None,
    operator_activity: OperatorActivity | None = None,
    raters: Sequence[RaterAgreement] = (),
) -> str:
    """Return the results as one JSON object.

    `models`: each condition with its settings, protocol, campaigns, seeds, `goals`, `goal_kinds` (totals; empty with
    one kind), `total`, `starts`, `end_reasons`, `actions`, `sensitivity`, `failures`, `judgements` and `courses`;
    `questions`: comparisons and rankings; `sim_vs_real`: real against simulated results; `stability`: driving time and
    distance of each robot; `published_stability`: that of the paper, null unless its models are included;
    `operator_activity`: operators and sessions, null with one operator in one session; `second_judgements`: agreement
    of each rater.
    """
    content = {
        "confidence": 0.95,
        "interval": _interval_name(results),
        "models": [model_fields(summary, activity, record) for summary in results.conditions],
        "questions": [_question(question) for question in questions],
        "sim_vs_real": [sim_vs_real_fields(pair) for pair in sim_real_pairs(results)],
        "stability": [_robot(robot) for robot in activity.robots] if activity else None,
        "published_stability": _published_stability()
        if any(summary.condition.published for summary in results.conditions)
        else None,
        "operator_activity": operator_fields(operator_activity),
        "second_judgements": second_judgement_fields(raters),
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _interval_name(results: Results) -> str:
    """Return the method of the intervals."""
    published = {summary.condition.published for summary in results.conditions}
    if published == {True}:
        return "wilson"
    clustered = "wilson, at the effective sample size of the starting positions"
    return f"{clustered}; wilson for published rows" if True in published else clustered


def model_fields(summary: ConditionSummary, activity: Activity | None, record: ReportData | None) -> dict[str, Any]:
    """Return one condition as JSON values.

    Args:
        summary: statistics of the condition.
        activity: actions, failures and judgements; null if None.
        record: the episodes, for the sensitivity analyses.
    """
    condition, number = summary.condition, summary.condition.number
    counts = None if condition.published else activity
    return {
        **condition_fields(condition),
        "campaigns": list(condition.campaigns),
        "seeds": list(condition.seeds),
        "differing": list(condition.differing),
        "settings": known(dict(condition.settings)),
        "protocol": known(dict(condition.protocol)),
        "conditions": known(dict(condition.conditions)),
        "goals": [GROUP.fields(group) for group in summary.goals],
        "goal_kinds": [GROUP.fields(group) for group in summary.kinds],
        "total": GROUP.fields(summary.total),
        "shared_goals": list(summary.shared_goals),
        "total_shared_goals": GROUP.fields(summary.shared) if summary.shared else None,
        "starts": [GROUP.fields(group) for group in summary.starts],
        "end_reasons": [ENDS.fields(row) for row in end_counts(summary)],
        "actions": [
            {"raw_action": usage.raw_action, "action": usage.action, "blocked": usage.blocked, "steps": usage.steps}
            for usage in counts.actions
            if usage.condition == number
        ]
        if counts
        else None,
        "sensitivity": sensitivity_fields(record, summary) if record and not condition.published else None,
        "failures": failure_fields(_of_condition(number, counts.failures)) if counts else None,
        "judgements": judgement_fields(_of_condition(number, counts.judgements)) if counts else None,
        "courses": course_fields(_of_condition(number, counts.courses)) if counts else None,
    }


def _of_condition(number: int, counts: Sequence[_Counts]) -> _Counts | None:
    return next((found for found in counts if found.condition == number), None)


def _question(question: Question) -> dict[str, Any]:
    return {
        "where": question.where,
        "members": [summary.condition.name for summary in question.members],
        "answers": list(question.answers),
        "not_compared": list(question.not_compared),
        "ranking": ranking_fields(question.ranking) if question.ranking else None,
        "comparisons": [comparison_fields(comparison) for comparison in question.comparisons],
    }


def _published_stability() -> dict[str, Any]:
    paper = published()
    robots = [robot.model_dump() for robot in paper.stability]
    return {"source": paper.source, "robots": robots, "hours": paper.hours, "kilometres": paper.kilometres}


def _robot(robot: RobotActivity) -> dict[str, Any]:
    fields: dict[str, Any] = known({**asdict(robot), "failures_per_km": robot.failures_per_km})
    return fields


def known(value: Any) -> Any:
    """Return a recorded value with null for numbers that JSON cannot represent."""
    if isinstance(value, dict):
        return {name: known(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [known(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
