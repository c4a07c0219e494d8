"""Reads the episodes of a record into a DataFrame, one row per episode, for all tables and figures.

A row takes about 200 bytes. Steps (10 million in a large record) stay in the database and are counted there.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Connection, Engine, Select, func, select, type_coerce
from sqlalchemy.types import NullType

from vsnbench.report.analysis.conditions import Condition, Selection, read_conditions
from vsnbench.report.analysis.efficiency import add_times, progress_of, soft_spl_of, spl_of
from vsnbench.results.fields import Field, Fields
from vsnbench.results.goals import RecordedGoal, ambiguous_names, definitions, site_contents
from vsnbench.results.model import EPISODE
from vsnbench.results.reading.read_model import COUNTED, RUNNING, SUPERSEDED, UNJUDGED, VOID, episodes_of_trials
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.tables import EpisodeRow, TrialRow
from vsnbench.sites.categories import GOAL_CATEGORIES

if TYPE_CHECKING:
    import pandas as pd

Integers = NDArray[np.integer[Any]]
Floats = NDArray[np.float64]
Rows = NDArray[np.bool_] | Integers | slice

_OF_RECORD = Fields(
    (
        EPISODE["id"],
        EPISODE["campaign_id"],
        Field("process", int, "number of the process that ran it", (EpisodeRow.process_id,)),
        Field(
            "session",
            int,
            "number of the operator session; 0 without an operator",
            (type_coerce(func.coalesce(EpisodeRow.session_id, 0), NullType()),),
        ),
        Field("trial", int, "number of the trial", (TrialRow.id,)),
        *EPISODE.only("goal", "start", "repetition", "state", "end_reason", "success", "actions", "path_m"),
        *EPISODE.only("shortest_m", "remaining_m", "distance_m", "goal_in_sight", "duration_s", "thinking_s"),
        *EPISODE.only("wall_duration_s", "started_at", "ended_at", "images_directory"),
    )
)
"""Quantities that are read from the database, in the order of the columns."""
_COMPUTED = {
    "condition": "number of the condition, see `ReportData.conditions`",
    "success": "according to the current verdict; False without a verdict",
    "thinking_s": "wall time of the model's inference, on a real robot; NaN in simulation and if unknown",
    "progress": EPISODE["progress"].description("NaN"),
    "spl": "success weighted by path length: 0 for a failure, NaN for a success of unknown length",
    "soft_spl": "SPL with progress instead of success; NaN if a length is unknown",
    "sct": "success weighted by completion time: 0 for a failure, NaN for a success of unknown time",
}
"""Columns that the report computes, or whose values it completes."""
_ORDER = (
    *("episode", "condition", "campaign", "process", "session", "trial", "goal", "start", "repetition", "state"),
    *("end_reason", "success", "actions", "path_m", "shortest_m", "remaining_m", "distance_m", "goal_in_sight"),
    *("duration_s", "thinking_s", "wall_duration_s", "progress", "spl", "soft_spl", "sct", "started_at", "ended_at"),
    "images_directory",
)


def _meanings() -> dict[str, str]:
    nothing = {float: "NaN", datetime: "NaT"}
    recorded = {quantity.heading: quantity.description(nothing.get(quantity.base, "None")) for quantity in _OF_RECORD}
    found = recorded | _COMPUTED
    return {name: found[name] for name in _ORDER}


COLUMNS = _meanings()
"""Columns of `ReportData.episodes` with their meaning."""


@dataclass(frozen=True, slots=True, eq=False)
class ReportData:
    """Conditions, episodes and planned trials of a report."""

    conditions: tuple[Condition, ...]
    episodes: "pd.DataFrame"
    """One row per episode, with the columns of `COLUMNS`."""
    planned: "pd.DataFrame"
    """Planned trials: condition, goal, start, trials."""
    sites: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """SHA-256 of a site -> its content."""
    results_directory: Path | None = None
    goals: Mapping[str, RecordedGoal] = field(default_factory=dict)
    """Definitions of the goals that are not categories, by the name in the column `goal`."""
    courses: "pd.DataFrame | None" = None
    """Measures of the examined episodes (`courses.measure_courses`); None until they are measured."""

    def of(self, condition: Condition) -> "pd.DataFrame":
        """Return the episodes of one condition."""
        return self.episodes[self.episodes["condition"] == condition.number]

    def counted(self, condition: Condition | None = None) -> "pd.DataFrame":
        """Return the counted episodes of one condition or of all."""
        rows = self.episodes if condition is None else self.of(condition)
        return rows[rows["state"] == COUNTED]


@dataclass(frozen=True, slots=True, eq=False)
class Codes:
    """A categorical column as integer codes."""

    numbers: Integers
    names: Sequence[str]

    def of(self, *names: str) -> NDArray[np.bool_]:
        """Return which rows have one of these values."""
        return np.isin(self.numbers, [self.names.index(name) for name in names if name in self.names])

    def __getitem__(self, rows: Rows) -> "Codes":
        return Codes(self.numbers[rows], self.names)


class EpisodeColumns:
    """Some rows of `ReportData.episodes`: an attribute is a column, as an array with one entry per episode.

    A column is read when it is asked for, so that many groups of the same episodes take little memory.
    """

    __slots__ = ("_columns", "_rows")

    def __init__(self, columns: Mapping[str, Any], rows: Integers) -> None:
        """Take rows of columns; those of categories are `Codes`."""
        self._columns, self._rows = columns, rows

    @classmethod
    def of(cls, episodes: "pd.DataFrame") -> Self:
        """Return all rows of `ReportData.episodes`, without the columns of texts and times."""
        columns = {
            str(name): Codes(values.cat.codes.to_numpy(), list(values.cat.categories))
            if values.dtype == "category"
            else values.to_numpy()
            for name, values in episodes.items()
            if values.dtype == "category" or values.dtype.kind in "biuf"
        }
        return cls(columns, np.arange(len(episodes)))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in self._columns:
            raise AttributeError(name)
        return self._columns[name][self._rows]

    def __getitem__(self, rows: Rows) -> Self:
        return type(self)(self._columns, self._rows[rows])

    def by(self, numbers: Integers) -> "Iterator[tuple[int, EpisodeColumns]]":
        """Yield each number and its episodes, in the order of the rows.

        Args:
            numbers: (episodes,) group of each episode.
        """
        order = np.argsort(numbers, kind="stable")
        values, begins = np.unique(numbers[order], return_index=True)
        for value, rows in zip(values.tolist(), np.split(order, begins[1:]), strict=False):
            yield value, self[rows]


def empty_report_data() -> ReportData:
    """Return an empty record, for published results without episodes."""
    import pandas as pd

    episodes = _whole(_typed([()] * len(_OF_RECORD.names)), {}).assign(sct=[])[list(COLUMNS)]
    return ReportData((), episodes, pd.DataFrame(columns=["condition", "goal", "start", "trials"]))


def goal_order(goal: str) -> tuple[int, str]:
    """Sort key: the order of the paper's tables, then alphabetical."""
    return (GOAL_CATEGORIES.index(goal) if goal in GOAL_CATEGORIES else len(GOAL_CATEGORIES), goal)


def read_report_data(
    engine: Engine, selection: Selection | None = None, results_directory: Path | None = None
) -> ReportData:
    """Read the data of a report."""
    chosen = selection or Selection()
    with record_errors(engine), engine.connect() as connection:
        conditions, condition_of = read_conditions(connection, chosen)
        episodes = add_times(_episodes(connection, chosen, condition_of), conditions)[list(COLUMNS)]
        planned = _planned(connection, chosen, condition_of)
        for (campaign, goal), name in ambiguous_names(connection).items():
            for frame in (episodes, planned):
                frame["goal"] = frame["goal"].astype(object)
                frame.loc[(frame["campaign"] == campaign) & (frame["goal"] == goal), "goal"] = name
        episodes["goal"] = episodes["goal"].astype("category")
        sites, goals = site_contents(connection, condition_of), definitions(connection)
    return ReportData(conditions, episodes, _grouped(planned), sites, results_directory, goals)


def trial_filter(chosen: Selection, condition_of: Mapping[int, int]) -> list[Any]:
    """Return SQL conditions for the trials of a selection."""
    # For all campaigns, `+ 0` keeps the database from using the index, which would return the episodes in another order
    # than the table's; sorting them is slower than reading them.
    some = chosen.models or chosen.sites or chosen.robots or chosen.campaigns
    campaign = TrialRow.campaign_id if some else TrialRow.campaign_id + 0
    wanted: list[Any] = [campaign.in_(list(condition_of))]
    if chosen.goals:
        wanted.append(TrialRow.goal.in_(chosen.goals))
    return wanted


def episodes_query() -> Select[Any]:
    """Select the quantities of `_OF_RECORD` of every episode, ordered by number."""
    # Truths and times are untyped: numpy and pandas convert them at once, SQLAlchemy one by one.
    columns = (
        type_coerce(quantity.sql[0], NullType()) if quantity.base in (bool, datetime) else quantity.sql[0]
        for quantity in _OF_RECORD
    )
    return episodes_of_trials(*columns).order_by(EpisodeRow.id)


_BATCH = 200
"""Rows alive at a time: the garbage collector traverses all of them repeatedly."""
_PART = 20_000
"""Episodes held as Python objects at a time, before conversion to NumPy arrays of a fifth of the size."""


def _episodes(connection: Connection, chosen: Selection, condition_of: Mapping[int, int]) -> "pd.DataFrame":
    import pandas as pd

    query = episodes_query().where(*trial_filter(chosen, condition_of))
    found = connection.execution_options(yield_per=_BATCH).execute(query)
    parts: list[pd.DataFrame] = []
    columns: list[list[Any]] = [[] for _ in _OF_RECORD]
    for rows in found.partitions():
        for column, values in zip(columns, zip(*rows, strict=True), strict=True):
            column.extend(values)
        if len(columns[0]) >= _PART:
            parts.append(_typed(columns))
            columns = [[] for _ in _OF_RECORD]
    parts.append(_typed(columns))
    frame = pd.concat(parts, ignore_index=True)
    return _whole(frame, condition_of)


def _whole(frame: "pd.DataFrame", condition_of: Mapping[int, int]) -> "pd.DataFrame":
    """Add the derived columns, in the order and with the types of `COLUMNS`."""
    import pandas as pd

    for name in ("goal", "end_reason"):
        frame[name] = frame[name].astype("category")
    frame["state"] = pd.Categorical(frame["state"], categories=[COUNTED, UNJUDGED, VOID, SUPERSEDED, RUNNING])
    frame.insert(1, "condition", frame["campaign"].map(dict(condition_of)).astype(np.int64))
    frame["progress"] = progress_of(frame)
    frame["spl"] = spl_of(frame)
    frame["soft_spl"] = soft_spl_of(frame)
    return frame


def _typed(columns: Sequence[Sequence[Any]]) -> "pd.DataFrame":
    """Convert the driver's values of `_OF_RECORD` to the types of a DataFrame, column by column for speed."""
    import pandas as pd

    typed: dict[str, Any] = {}
    for quantity, values in zip(_OF_RECORD, columns, strict=True):
        if quantity.base is float:
            numbers = np.array(values, np.float64)
            # Other writers may store infinities.
            typed[quantity.heading] = np.where(np.isfinite(numbers), numbers, np.nan)
        elif quantity.base is datetime:
            typed[quantity.heading] = pd.to_datetime(pd.Series(values, dtype=object), utc=True, format="ISO8601")
        else:
            typed[quantity.heading] = np.array(values, {int: np.int64, bool: bool}.get(quantity.base, object))
    return pd.DataFrame(typed)


def _planned(connection: Connection, chosen: Selection, condition_of: Mapping[int, int]) -> "pd.DataFrame":
    import pandas as pd

    rows = connection.execute(
        select(TrialRow.campaign_id, TrialRow.goal, TrialRow.start, func.count())
        .where(*trial_filter(chosen, condition_of))
        .group_by(TrialRow.campaign_id, TrialRow.goal, TrialRow.start)
    ).all()
    frame = pd.DataFrame([tuple(row) for row in rows], columns=["campaign", "goal", "start", "trials"])
    frame["condition"] = frame["campaign"].map(dict(condition_of)).astype(np.int64)
    return frame


def _grouped(frame: "pd.DataFrame") -> "pd.DataFrame":
    """Return the planned trials by condition, goal and start."""
    grouped = frame.groupby(["condition", "goal", "start"], observed=True)["trials"].sum().reset_index()
    for name in ("start", "trials"):
        grouped[name] = grouped[name].astype(np.int64)
    return grouped
