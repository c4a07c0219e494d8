"""Puts a report together: opens the record, refuses what it has nothing to say about, chooses the sheets."""

from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import Engine

from vsnbench.database.engine import shown_database
from vsnbench.database.migrate import open_record
from vsnbench.errors import RecordError, UsageError
from vsnbench.harmless_text import harmless
from vsnbench.report.record import Record, Selection, goal_order, read_record
from vsnbench.report.sheets import Sheet
from vsnbench.report.summary import Results, summarise
from vsnbench.report.tables import (
    action_sheet,
    end_sheet,
    goal_sheet,
    overview_sheet,
    stability_sheet,
    start_sheet,
)

if TYPE_CHECKING:  # a table alone needs none of them, and importing them takes as long as reading a small record
    from vsnbench.report.activity import ActionCount, Activity
    from vsnbench.report.attended import Attended
    from vsnbench.report.question import Question


def read(url: str, selection: Selection, results_directory: Path | None = None) -> Record:
    """Read the record in a database.

    Args:
        url: any SQLAlchemy URL.
        selection: which part of it.
        results_directory: where the images of its episodes lie.

    Raises:
        RecordError: there is no record, nothing in it, or it cannot be read.
        UsageError: the selection fits nothing in it.
    """
    with open_record(url) as engine:
        return _read(engine, selection, results_directory)


def _read(engine: Engine, selection: Selection, results_directory: Path | None) -> Record:
    record = read_record(engine, selection, results_directory)
    if record.conditions and not record.planned.empty:
        return record
    everything = read_record(engine, Selection(), results_directory)
    if not everything.conditions:
        raise RecordError(
            f"the record in {shown_database(engine)} holds no campaign yet", advice="`vsnbench run` makes one"
        )
    models = ", ".join(sorted({harmless(one.model) for one in everything.conditions}))
    goals = ", ".join(sorted({harmless(goal) for goal in everything.planned["goal"]}, key=goal_order))
    raise UsageError(f"nothing in the record fits that selection: its models are {models}; its goals are {goals}")


@dataclass(frozen=True, slots=True)
class Report:
    """A record, its numbers and its sheets."""

    record: Record
    results: Results
    activity: "Activity | None" = None
    """None where only the rates were asked for."""
    reference: bool = False
    """The paper's numbers are laid beside."""
    questions: "tuple[Question, ...]" = ()
    """Which model succeeds more often, wherever that can be asked; empty where only the rates were asked for."""
    attended: "Attended | None" = None
    """Who stood beside the robot; None where it was one person in one session, or nobody."""

    def sheets(self, *, long: bool = False) -> list[Sheet]:
        """Return the sheets in the order in which they are read; `long` adds those that are long."""
        results = self.results
        sheets = self._question_sheets()
        if len(results.conditions) > 1:
            sheets.append(overview_sheet(results))
        sheets += [goal_sheet(one) for one in results.conditions]
        if self.reference:
            from vsnbench.report.reference_tables import beside_sheet

            sheets.append(beside_sheet(results))
        sheets += self._twin_sheets(long=long)
        if any(one.ends for one in results.conditions):
            sheets.append(end_sheet(results))
        if self.activity:
            sheets.append(stability_sheet(self.activity.robots))
            if self.reference:
                from vsnbench.report.reference_tables import paper_stability_sheet

                sheets.append(paper_stability_sheet())
            if self.activity.actions:
                sheets.append(action_sheet(results, self.activity.actions))
        if self.activity:
            from vsnbench.report.scrutiny_tables import failure_sheet, judgement_sheet

            failures = failure_sheet(results, self.activity.failures)
            judgements = judgement_sheet(results, self.activity.judgements)
            sheets += [sheet for sheet in (failures, judgements) if sheet]
        sheets += self._attended_sheets(long=long)
        if long:
            from vsnbench.report.scrutiny_tables import scrutiny_sheets

            sheets += scrutiny_sheets(self.record, results)
            sheets += [start_sheet(one) for one in results.conditions]
        return sheets

    def _attended_sheets(self, *, long: bool) -> list[Sheet]:
        if self.attended is None:
            return []
        from vsnbench.report.attended_tables import operator_sheet, session_sheet
        from vsnbench.report.scrutiny_tables import drift_sheet

        sheets = [operator_sheet(self.attended)]
        if self.attended.sessions:
            sheets.append(session_sheet(self.attended))
        if not long and (over_time := drift_sheet(self.record, self.results)).rows:
            sheets.append(over_time)
        return sheets

    def _question_sheets(self) -> list[Sheet]:
        if not self.questions:
            return []
        from vsnbench.report.question_tables import question_sheets

        return question_sheets(self.questions)

    def _twin_sheets(self, *, long: bool) -> list[Sheet]:
        """Return what the simulated trials of a model say of its real ones, where there are both."""
        if len({one.condition.simulated for one in self.results.conditions}) < 2:
            return []
        from vsnbench.report.twins import real_sheet, twin_sheet, twins

        found = twins(self.results)
        sheets = (real_sheet(found), twin_sheet(found) if long else None)
        return [sheet for sheet in sheets if sheet]


def build(
    url: str,
    selection: Selection,
    results_directory: Path | None = None,
    *,
    reference: bool = False,
    activity: bool = True,
    meanwhile: Callable[[Report], None] | None = None,
    beside: Executor | None = None,
) -> Report:
    """Read a record and condense it.

    Args:
        url: any SQLAlchemy URL.
        selection: which part of it.
        results_directory: where the images of its episodes lie.
        reference: lay the paper's numbers beside.
        activity: count actions and distances, and compare models, too.
        meanwhile: is handed the report without its activity while the actions are still counted.
        beside: counts the actions; a thread when absent, which takes longer: SQLite's threads wait for one another.

    Raises:
        RecordError: there is no record, nothing in it, or it cannot be read.
        UsageError: the selection fits nothing in it.
    """
    if not activity:
        with open_record(url) as engine:
            record = _read(engine, selection, results_directory)
            # A record that nobody stood beside is not asked who did: most are such, and a plain table comes at once.
            attended = _attended(engine, record) if record.episodes["session"].nunique() > 1 else None
        return Report(record, summarise(record), reference=reference, attended=attended)
    from vsnbench.report.activity import Activity, read_robots
    from vsnbench.report.failures import read_failures
    from vsnbench.report.judgements import read_judgements
    from vsnbench.report.question import questions

    with nullcontext(beside) if beside else ThreadPoolExecutor(1) as counter:
        # Handed over before the record is opened here: a forked process must not inherit that.
        counting = counter.submit(_actions, url, selection)
        with open_record(url) as engine:
            record = _read(engine, selection, results_directory)
            attended, results = _attended(engine, record), summarise(record)
            report = Report(
                record, results, reference=reference, questions=questions(record, results), attended=attended
            )
            robots = read_robots(engine, record)
            if meanwhile:
                meanwhile(report)
            failures, judgements = read_failures(engine, record), read_judgements(engine, record)
        return replace(report, activity=Activity(counting.result(), robots, failures, judgements))


def _attended(engine: Engine, record: Record) -> "Attended | None":
    from vsnbench.report.attended import read_attended

    return read_attended(engine, record)


def _actions(url: str, selection: Selection) -> "tuple[ActionCount, ...]":
    from vsnbench.report.activity import read_actions

    with open_record(url) as engine:
        return read_actions(engine, selection)
