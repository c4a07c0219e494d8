"""The whole report as one JSON object: rates from 0 to 1, null if unknown."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from vsnbench.report.analysis.activity import Activity, Rows
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.operators import OperatorActivity
from vsnbench.report.analysis.published import Published, published
from vsnbench.report.analysis.summary import ConditionSummary, ReportResults
from vsnbench.report.comparison.question import ModelQuestion
from vsnbench.report.comparison.sim_vs_real import sim_real_pairs
from vsnbench.report.measures import (
    ANYTHING,
    NUMBERS,
    TEXT,
    TEXTS,
    Form,
    Measure,
    Measures,
    an_object,
    objects,
)
from vsnbench.report.tables import operators
from vsnbench.report.tables.activity import ACTIONS, ENDS, ODOMETRY, ROBOTS, end_counts
from vsnbench.report.tables.comparison import COMPARISON
from vsnbench.report.tables.conditions import CONDITION
from vsnbench.report.tables.failures import FAILURES, JUDGEMENTS
from vsnbench.report.tables.progress import COURSES, LEGS
from vsnbench.report.tables.question import QUESTION
from vsnbench.report.tables.ranking import RANKING
from vsnbench.report.tables.second_judgements import RATERS
from vsnbench.report.tables.sensitivity import SENSITIVITY
from vsnbench.report.tables.sim_vs_real import SIM_VS_REAL
from vsnbench.report.tables.success import GROUP


@dataclass(frozen=True, slots=True)
class ConditionRow:
    """A condition with what is known of it."""

    summary: ConditionSummary
    activity: Activity | None = None
    record: ReportData | None = None

    def counted(self, name: str) -> Rows | None:
        """Return the condition's rows of `Activity`; None without activity and for published results."""
        if self.activity is None or self.summary.condition.published:
            return None
        return [row for row in getattr(self.activity, name) if row["condition"] == self.summary.condition.number]

    def only(self, name: str) -> Mapping[str, Any] | None:
        """Return the condition's row of `Activity`; None without one."""
        return next(iter(self.counted(name) or ()), None)

    @property
    def legs(self) -> Rows:
        """The positions in the condition's sequences; none for published results."""
        if self.record is None or self.summary.condition.published:
            return ()
        return [row for row in self.record.legs if row["condition"] == self.summary.condition.number]

    @property
    def part(self) -> tuple[ReportData, ConditionSummary] | None:
        """The episodes of the condition, for the sensitivity analyses; None for published results."""
        return (self.record, self.summary) if self.record and not self.summary.condition.published else None


_DIFFERING = "settings that differ from other conditions of the same model, as `name=value`"
_CIRCUMSTANCES = "recorded circumstances such as noise and disturbances; keys depend on the robot"
_UNLESS = "for published results, and in `compare`"
_RULES = "success rate under other rules and in parts of the episodes"
_STATED = Measures(
    *CONDITION,
    Measure("campaigns", NUMBERS, "numbers of the pooled campaigns"),
    Measure("seeds", NUMBERS, "seeds of the campaigns, in the same order"),
    Measure("differing", TEXTS, _DIFFERING),
    Measure("settings", ANYTHING, "recorded settings of the model; keys depend on the model"),
    Measure("protocol", ANYTHING, "recorded parameters of the protocol; empty for a published result"),
    Measure("conditions", ANYTHING, _CIRCUMSTANCES),
)
_GROUPS = Measures(
    Measure("goals", objects(GROUP), "one summary per goal"),
    Measure("goal_kinds", objects(GROUP), "one summary per kind of goal; empty if all are of one kind", "kinds"),
    Measure("total", an_object(GROUP), "summary over all goals"),
    Measure("shared_goals", TEXTS, "goals that all comparable conditions share"),
    Measure(
        "total_shared_goals",
        an_object(GROUP),
        "summary over the shared goals",
        "shared",
        null="if it equals `total`",
    ),
    Measure("starts", objects(GROUP), "one summary per starting position"),
    Measure("end_reasons", objects(ENDS), "numbers of episodes, one object per end reason", end_counts),
)
MODEL = Measures.shared(
    "condition",
    *_STATED.within("summary.condition"),
    *_GROUPS.within("summary"),
    Measure(
        "actions",
        objects(ACTIONS),
        "actions of the counted episodes",
        lambda row: row.counted("actions"),
        null=_UNLESS,
    ),
    Measure("sensitivity", an_object(SENSITIVITY), _RULES, "part", null="for published results"),
    Measure(
        "failures",
        an_object(FAILURES),
        "failed episodes by cause",
        lambda row: row.only("failures"),
        null=f"without failures, {_UNLESS}",
    ),
    Measure(
        "judgements",
        an_object(JUDGEMENTS),
        "judgements of operators",
        lambda row: row.only("judgements"),
        null=f"without any, {_UNLESS}",
    ),
    Measure(
        "courses",
        an_object(COURSES),
        "stages and driven paths",
        lambda row: row.only("courses"),
        null=f"without counted episodes, {_UNLESS}",
    ),
    Measure(
        "sequences",
        objects(LEGS),
        "success by position in a sequence of goals, and of whole sequences",
        lambda row: row.legs or None,
        only_in="records with sequences",
    ),
)
"""The JSON object of a condition, from a `ConditionRow`."""
_PLAIN = Form({"type": "number"})
_PUBLISHED_ROBOT = Measures(
    Measure("robot", TEXT, "name of the robot"),
    Measure("hours", _PLAIN, "driving time of the robot in hours"),
    Measure("kilometres", _PLAIN, "length of its paths in kilometres"),
)
_PUBLISHED = Measures(
    Measure("source", TEXT, "reference of the paper"),
    Measure("robots", objects(_PUBLISHED_ROBOT), "one object per robot", "stability"),
    Measure("hours", _PLAIN, "driving time of all robots in hours"),
    Measure("kilometres", _PLAIN, "length of all paths in kilometres"),
)
_ONE = "with one operator in one session"
REPORT = Measures(
    Measure("confidence", _PLAIN, "level of all intervals", lambda _: 0.95),
    Measure(
        "interval", TEXT, "method of the intervals of the success rates", lambda row: _interval_name(row["results"])
    ),
    Measure("models", objects(MODEL), "one object per condition"),
    Measure("questions", objects(QUESTION), "comparisons, one object per robot, site and protocol"),
    Measure(
        "sim_vs_real",
        objects(SIM_VS_REAL),
        "real compared with simulated",
        lambda row: sim_real_pairs(row["results"]),
    ),
    Measure("stability", objects(ROBOTS), "driving of each robot, over all episodes, void ones included"),
    Measure(
        "odometry",
        objects(ODOMETRY),
        "drift of each robot, by the poses measured after STOP",
        only_in="records with such poses",
    ),
    Measure(
        "published_stability",
        an_object(_PUBLISHED),
        "driving in the paper",
        lambda row: _paper(row["results"]),
        null="without --reference",
    ),
    Measure("operator_activity", an_object(operators.ACTIVITY), "operators and sessions", null=_ONE),
    Measure("second_judgements", objects(RATERS), "agreement of second raters with the verdicts, one object per rater"),
)
"""The JSON object of a report."""


COMPARED = Measures(
    Measure("ranking", an_object(RANKING), "all models at once", null="with fewer than three"),
    Measure("comparisons", objects(COMPARISON), "pairs of conditions"),
    Measure(
        "models",
        objects(MODEL),
        "one object per condition",
        lambda row: [ConditionRow(summary, record=row["record"]) for summary in row["summaries"]],
    ),
    Measure(
        "sim_vs_real",
        objects(SIM_VS_REAL),
        "real compared with simulated",
        lambda row: sim_real_pairs(ReportResults(tuple(row["summaries"]))),
    ),
)
"""The JSON object of `vsnbench compare`."""


def to_json(
    results: ReportResults,
    questions: Sequence[ModelQuestion] = (),
    activity: Activity | None = None,
    record: ReportData | None = None,
    operator_activity: OperatorActivity | None = None,
    raters: Rows = (),
) -> str:
    """Return the results as one JSON object, as `REPORT` and docs/schemas/report.json describe it."""
    row = {
        "results": results,
        "models": [ConditionRow(summary, activity, record) for summary in results.conditions],
        "questions": questions,
        "stability": activity.robots if activity else None,
        "odometry": (activity.stops or None) if activity else None,
        "operator_activity": operator_activity,
        "second_judgements": raters,
    }
    return json.dumps(REPORT.fields(row), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _interval_name(results: ReportResults) -> str:
    """Return the method of the intervals."""
    published = {summary.condition.published for summary in results.conditions}
    if published == {True}:
        return "wilson"
    clustered = "wilson, at the effective sample size of the starting positions"
    return f"{clustered}; wilson for published rows" if True in published else clustered


def _paper(results: ReportResults) -> Published | None:
    return published() if any(summary.condition.published for summary in results.conditions) else None
