"""Builds a report: reads the record, checks the selection and chooses the tables."""

from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import Engine

from vsnbench.errors import RecordError, UsageError
from vsnbench.protocol.execution import STACK
from vsnbench.report.analysis.activity import Activity, Rows, read_actions, read_robots, read_stops
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.episodes_frame import ReportData, read_report_data
from vsnbench.report.analysis.judgements import read_judgements, read_rater_agreements
from vsnbench.report.analysis.operators import OperatorActivity, has_sessions, read_operator_activity
from vsnbench.report.analysis.summary import ReportResults, summarise
from vsnbench.report.comparison.sim_vs_real import sim_real_pairs
from vsnbench.report.table import ReportTable
from vsnbench.report.tables.activity import (
    action_table,
    definition_table,
    end_reason_table,
    odometry_table,
    stability_table,
)
from vsnbench.report.tables.operators import operator_table, session_table
from vsnbench.report.tables.second_judgements import second_judgement_tables
from vsnbench.report.tables.sim_vs_real import cell_agreement_table, sim_vs_real_table, twin_goal_table
from vsnbench.report.tables.success import goal_table, overview_table, start_table
from vsnbench.results.schema.engine import database_label
from vsnbench.results.schema.migrate import open_record
from vsnbench.text.sanitize import sanitize
from vsnbench.text.suggestions import unknown_name
from vsnbench.values.goal import GoalKind

if TYPE_CHECKING:  # success tables need little: the modules of the others are imported where those are made
    from vsnbench.report.analysis.courses import Examined
    from vsnbench.report.comparison.question import ModelQuestion


def read(url: str, selection: Selection, results_directory: Path | None = None) -> ReportData:
    """Read the record of a database.

    Raises:
        RecordError: no record exists, it is empty or it cannot be read.
        UsageError: nothing in the record matches the selection.
    """
    with open_record(url) as engine:
        return _read(engine, selection, results_directory)


def _read(
    engine: Engine,
    selection: Selection,
    results_directory: Path | None,
    examined: "Examined | None" = None,
    *,
    for_success: bool = False,
) -> ReportData:
    record = read_report_data(engine, selection, results_directory, for_success=for_success)
    if record.conditions and record.planned:
        if any(condition.execution == STACK for condition in record.conditions):
            from vsnbench.report.analysis.courses import with_stacks

            record = with_stacks(engine, record, {} if examined is None else examined)
        if any(goal.kind is GoalKind.SEQUENCE for goal in record.goals.values()):
            from vsnbench.report.analysis.sequences import read_legs

            return replace(record, legs=read_legs(engine, record))
        return record
    everything = read_report_data(engine, Selection(), results_directory, for_success=True)
    if not everything.conditions:
        raise RecordError(
            f"the record in {database_label(engine)} holds no campaign to report",
            advice="`vsnbench run` adds one; withdrawn imports do not count",
        )
    raise UsageError(_why_nothing_fits(selection, everything))


def _why_nothing_fits(selection: Selection, everything: ReportData) -> str:
    """Return which value of a selection is unknown, or the values that the record has."""
    recorded = {
        "model": (selection.models, {sanitize(summary.model) for summary in everything.conditions}),
        "goal": (selection.goals, {sanitize(goal) for _, goal, _ in everything.planned}),
        "site": (selection.sites, {sanitize(summary.site) for summary in everything.conditions}),
        "robot": (selection.robots, {sanitize(summary.robot) for summary in everything.conditions}),
    }
    for kind, (asked, known) in recorded.items():
        for word in asked:
            if word not in known:
                return unknown_name(kind, word, known, "this record")
    has = "; ".join(f"{kind}s: {', '.join(sorted(known))}" for kind, (_, known) in recorded.items())
    return f"no episode in this record matches all of these; it has {has}"


@dataclass(frozen=True, slots=True)
class Report:
    """A record, its statistics and its tables."""

    record: ReportData
    results: ReportResults
    activity: Activity | None = None
    """None if only the rates were requested."""
    reference: bool = False
    """Show the paper's results next to the recorded ones."""
    questions: "tuple[ModelQuestion, ...]" = ()
    """Comparisons of models; empty if only the rates were requested."""
    operator_activity: OperatorActivity | None = None
    """None without operators, or with one operator in one session."""
    raters: Rows = ()
    """Agreement of blind second judgements with the verdicts."""

    def tables(self, *, long: bool = False) -> list[ReportTable]:
        """Return the tables in reading order; `long` adds the long ones."""
        results, activity = self.results, self.activity
        tables: list[ReportTable] = []
        if self.questions:
            from vsnbench.report.tables.question import question_tables

            tables += question_tables(self.questions)
        if len(results.conditions) > 1:
            tables.append(overview_table(results))
        tables += [goal_table(summary) for summary in results.conditions]
        if self.record.legs:
            from vsnbench.report.tables.progress import sequence_table

            tables.append(sequence_table(results, self.record.legs))
        if (defined := definition_table(self.record.goals, results)) is not None:
            tables.append(defined)
        if self.reference:
            from vsnbench.report.tables.reference import paper_comparison_table

            tables.append(paper_comparison_table(results))
        tables += self._sim_vs_real_tables(long=long)
        if (ends := end_reason_table(results)).rows:
            tables.append(ends)
        if activity:
            tables += self._activity_tables(activity)
        tables += second_judgement_tables(self.raters)
        tables += self._operator_tables(long=long)
        if long:
            from vsnbench.report.tables.sensitivity import sensitivity_tables

            tables += sensitivity_tables(self.record, results)
            tables += [start_table(summary) for summary in results.conditions]
        return tables

    def _activity_tables(self, activity: Activity) -> list[ReportTable]:
        from vsnbench.report.tables.failures import failure_table, judgement_table, narrative_table
        from vsnbench.report.tables.progress import progress_tables
        from vsnbench.report.tables.reference import paper_stability_table

        tables = [stability_table(activity.robots)]
        if activity.stops:
            tables.append(odometry_table(activity.stops))
        if self.reference:
            tables.append(paper_stability_table())
        if activity.actions:
            tables.append(action_table(self.results, activity.actions))
        found = (
            failure_table(self.results, activity.failures),
            narrative_table(self.results, activity.failures),
            judgement_table(self.results, activity.judgements),
        )
        tables += [table for table in found if table]
        return [*tables, *progress_tables(self.record, self.results, activity)]

    def _operator_tables(self, *, long: bool) -> list[ReportTable]:
        if self.operator_activity is None:
            return []
        from vsnbench.report.tables.sensitivity import drift_table

        tables = [operator_table(self.operator_activity)]
        if self.operator_activity["sessions"]:
            tables.append(session_table(self.operator_activity))
        if not long and (over_time := drift_table(self.record, self.results)).rows:
            tables.append(over_time)
        return tables

    def _sim_vs_real_tables(self, *, long: bool) -> list[ReportTable]:
        """Return the tables that compare simulated and real trials, if both exist."""
        found = sim_real_pairs(self.results)
        by_goal = twin_goal_table(sim_real_pairs(self.results, by_goal=True)) if len(found) > 1 else None
        tables = (sim_vs_real_table(found), by_goal, cell_agreement_table(found) if long else None)
        return [table for table in tables if table]


def build(
    url: str,
    selection: Selection,
    results_directory: Path | None = None,
    *,
    reference: bool = False,
    activity: bool = True,
    meanwhile: Callable[[Report], None] | None = None,
    executor: Executor | None = None,
) -> Report:
    """Read a record and compute its report.

    Args:
        url: SQLAlchemy URL.
        selection: part of the record to read.
        results_directory: directory with the images of the episodes.
        reference: show the paper's results next to the recorded ones.
        activity: also count actions and distances, and compare models; without it, the record has only the columns that
            the success tables need, unless it has operators.
        meanwhile: receives the report without its activity while the actions are still being counted.
        executor: counts the actions. Default: a thread, which is slower because SQLite's threads block one another.

    Raises:
        RecordError: no record exists, it is empty or it cannot be read.
        UsageError: nothing in the record matches the selection.
    """
    if not activity:
        with open_record(url) as engine:
            # Most records have no operators: the success tables need fewer columns.
            attended = has_sessions(engine)
            record = _read(engine, selection, results_directory, for_success=not attended)
            several = attended and record.episodes["session"].nunique() > 1
            operator_activity = read_operator_activity(engine, record) if several else None
            raters = read_rater_agreements(engine, record)
        results = summarise(record)
        return Report(record, results, reference=reference, operator_activity=operator_activity, raters=raters)
    from vsnbench.report.analysis.courses import measure_courses
    from vsnbench.report.analysis.failures import read_failures
    from vsnbench.report.comparison.question import questions

    with nullcontext(executor) if executor else ThreadPoolExecutor(1) as counter:
        # Submitted before the record is opened, because a forked process must not inherit the connection.
        counting = counter.submit(_actions, url, selection)
        with open_record(url) as engine:
            examined: Examined = {}
            record = _read(engine, selection, results_directory, examined)
            results = summarise(record)
            measured, courses = measure_courses(engine, record, examined=examined)
            record = replace(record, courses=measured)
            report = Report(
                record,
                results,
                reference=reference,
                questions=questions(record, results),
                operator_activity=read_operator_activity(engine, record),
                raters=read_rater_agreements(engine, record),
            )
            robots, stops = read_robots(engine, record), read_stops(engine, record)
            if meanwhile:
                meanwhile(report)
            failures, judgements = read_failures(engine, record, examined), read_judgements(engine, record)
        return replace(report, activity=Activity(counting.result(), robots, failures, judgements, courses, stops))


def _actions(url: str, selection: Selection) -> Rows:
    with open_record(url) as engine:
        return read_actions(engine, selection)
