"""Puts a report together: opens the record, refuses what it has nothing to say about, chooses the sheets."""

from pathlib import Path

from vsnbench.database.engine import shown_url
from vsnbench.database.migrate import open_record
from vsnbench.errors import RecordError, UsageError
from vsnbench.report.record import Record, Selection, goal_order, read_record
from vsnbench.report.sheets import Sheet
from vsnbench.report.summary import Results
from vsnbench.report.tables import end_sheet, goal_sheet, start_sheet
from vsnbench.report.text import harmless


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
    engine = open_record(url)
    try:
        record = read_record(engine, selection, results_directory)
        if record.conditions and not record.planned.empty:
            return record
        everything = read_record(engine, Selection(), results_directory)
    finally:
        engine.dispose()
    if not everything.conditions:
        raise RecordError(f"the record in {shown_url(url)} holds no campaign yet: `vsnbench run` makes one")
    models = ", ".join(sorted({harmless(one.model) for one in everything.conditions}))
    goals = ", ".join(sorted({harmless(goal) for goal in everything.planned["goal"]}, key=goal_order))
    raise UsageError(f"nothing in the record fits that selection: its models are {models}; its goals are {goals}")


def tables(results: Results) -> list[Sheet]:
    """Return the sheets of a report in the order in which they are read."""
    sheets = [goal_sheet(one, results.shared_goals) for one in results.conditions]
    if any(one.ends for one in results.conditions):
        sheets.append(end_sheet(results))
    return sheets


def all_tables(results: Results) -> list[Sheet]:
    """Return every sheet there is, the long ones too."""
    return [*tables(results), *(start_sheet(one) for one in results.conditions)]
