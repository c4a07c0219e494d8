"""Reads the episodes of a record as columns, one entry per episode, for all tables and figures.

An episode takes about 200 bytes. Steps (10 million in a large record) stay in the database and are counted there. The
columns become a DataFrame for those who ask for one: success tables do not, and loading pandas takes as long as reading
50,000 episodes.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Connection, Engine, Select, func, select, type_coerce
from sqlalchemy.types import NullType

from vsnbench.protocol.execution import STACK
from vsnbench.report.analysis.conditions import Condition, Selection
from vsnbench.report.analysis.efficiency import add_times, progress_of, soft_spl_of, spl_of
from vsnbench.report.analysis.reading import read_conditions
from vsnbench.results.fields import Field, Fields
from vsnbench.results.goals import RecordedGoal, ambiguous_names, definitions, site_contents
from vsnbench.results.model import EPISODE, TABLE
from vsnbench.results.reading.read_model import COUNTED, RUNNING, SUPERSEDED, UNJUDGED, VOID, episodes_with
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.tables import EpisodeRow, TrialRow
from vsnbench.sites.categories import GOAL_CATEGORIES

if TYPE_CHECKING:
    import pandas as pd

Integers = NDArray[np.integer[Any]]
Floats = NDArray[np.float64]
Rows = NDArray[np.bool_] | Integers | slice

_SESSION = type_coerce(func.coalesce(EpisodeRow.session_id, 0), NullType())
_OF_RECORD = Fields(
    (
        *TABLE,
        Field("process", int, "number of the process that ran it", (EpisodeRow.process_id,)),
        Field("session", int, "number of the operator session; 0 without an operator", (_SESSION,)),
        Field("trial", int, "number of the trial", (TrialRow.id,)),
    )
).single("duration_s")
"""Quantities that are read from the database."""
_OF_SUCCESS = TABLE.only(
    *("id", "campaign_id", "goal", "start", "state", "end_reason", "success", "actions", "path_m", "shortest_m"),
    *("remaining_m", "distance_m", "duration_s", "thinking_s"),
)
"""Quantities that the success tables need."""
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
_AFTER = {
    "episode": ("condition",),
    "campaign": ("process", "session", "trial"),
    "wall_duration_s": ("progress", "spl", "soft_spl", "sct"),
}
"""Column of `TABLE` -> the columns that follow it."""


def _meanings() -> dict[str, str]:
    nothing = {float: "NaN", datetime: "NaT"}
    recorded = {quantity.heading: quantity.description(nothing.get(quantity.base, "None")) for quantity in _OF_RECORD}
    found = recorded | _COMPUTED
    return {name: found[name] for own in TABLE.headings() for name in (own, *_AFTER.get(own, ()))}


COLUMNS = _meanings()
"""Columns of `ReportData.episodes` with their meaning."""


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
    """Some episodes of a record: an attribute is a column of `COLUMNS`, as an array with one entry per episode.

    Texts are `Codes`; times are as in the database. A column is read when asked for: many groups take little memory.
    """

    __slots__ = ("_columns", "_frame", "_rows")

    def __init__(self, columns: Mapping[str, Any], rows: Integers) -> None:
        self._columns, self._rows = columns, rows
        self._frame: pd.DataFrame | None = None

    @property
    def frame(self) -> "pd.DataFrame":
        """The episodes as a DataFrame, with the columns that were read; made when it is first asked for."""
        if self._frame is None:
            import pandas as pd

            names = [name for name in COLUMNS if name in self._columns]
            self._frame = pd.DataFrame({name: _of_frame(name, getattr(self, name)) for name in names})
        return self._frame

    def __len__(self) -> int:
        return len(self._rows)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in self._columns:
            raise AttributeError(name)
        return self._columns[name][self._rows]

    def __getitem__(self, rows: Rows) -> Self:
        return type(self)(self._columns, self._rows[rows])

    def and_also(self, **columns: NDArray[Any]) -> Self:
        """Return the episodes with further columns, with one entry per episode; they are not in `frame`."""
        return type(self)({**self._columns, **columns}, self._rows)

    def by(self, numbers: Integers) -> "Iterator[tuple[int, EpisodeColumns]]":
        """Yield each number of (episodes,) groups and its episodes, in the order of the rows."""
        order = np.argsort(numbers, kind="stable")
        values, begins = np.unique(numbers[order], return_index=True)
        for value, rows in zip(values.tolist(), np.split(order, begins[1:]), strict=False):
            yield value, self[rows]


@dataclass(frozen=True, slots=True, eq=False)
class ReportData:
    """Conditions, episodes and planned trials of a report."""

    conditions: tuple[Condition, ...]
    columns: EpisodeColumns
    planned: Mapping[tuple[int, str, int], int]
    """(number of the condition, goal, starting position) -> number of planned trials."""
    sites: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """SHA-256 of a site -> its content."""
    results_directory: Path | None = None
    goals: Mapping[str, RecordedGoal] = field(default_factory=dict)
    """Definitions of the goals that are not categories, by the name in the column `goal`."""
    legs: Sequence[Mapping[str, Any]] = ()
    """Positions of the goals in the sequences of each condition (`tables.progress.LEGS`)."""
    courses: "pd.DataFrame | None" = None
    """Measures of the examined episodes (`courses.measure_courses`); None until they are measured."""

    @property
    def episodes(self) -> "pd.DataFrame":
        """One row per episode, with the columns of `COLUMNS`."""
        return self.columns.frame

    def of(self, condition: Condition) -> "pd.DataFrame":
        """Return the episodes of one condition."""
        return self.episodes[self.episodes["condition"] == condition.number]

    def counted(self, condition: Condition | None = None) -> "pd.DataFrame":
        """Return the counted episodes of one condition or of all."""
        rows = self.episodes if condition is None else self.of(condition)
        return rows[rows["state"] == COUNTED]


def empty_report_data() -> ReportData:
    """Return an empty record, for published results without episodes."""
    nothing = {quantity.heading: _typed(quantity, (), {}) for quantity in _OF_RECORD}
    return ReportData((), _whole(nothing, {}, (), {}, {}), {})


def goal_order(goal: str) -> tuple[int, str]:
    """Sort key: the order of the paper's tables, then alphabetical."""
    return (GOAL_CATEGORIES.index(goal) if goal in GOAL_CATEGORIES else len(GOAL_CATEGORIES), goal)


def read_report_data(
    engine: Engine,
    selection: Selection | None = None,
    results_directory: Path | None = None,
    *,
    for_success: bool = False,
) -> ReportData:
    """Read the data of a report.

    Args:
        engine: the database.
        selection: part of the record.
        results_directory: directory with the images of the episodes.
        for_success: read only the columns that the success tables need.
    """
    chosen = selection or Selection()
    with record_errors(engine), engine.connect() as connection:
        conditions, condition_of = read_conditions(connection, chosen)
        renamed = ambiguous_names(connection)
        quantities = _OF_SUCCESS if for_success else _OF_RECORD
        codes: _Codes = {}
        read = _read(connection, quantities, trial_filter(chosen, condition_of), codes)
        columns = _whole(read, codes, conditions, condition_of, renamed)
        planned = _planned(connection, chosen, condition_of, renamed)
        sites, goals = site_contents(connection, condition_of), definitions(connection)
    return ReportData(conditions, columns, planned, sites, results_directory, goals)


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


def episodes_query(quantities: Fields = _OF_RECORD) -> Select[Any]:
    """Select quantities of `_OF_RECORD` of every episode, ordered by number."""
    # Truths and times are untyped: numpy and pandas convert them at once, SQLAlchemy one by one.
    columns = (
        type_coerce(quantity.sql[0], NullType()) if quantity.base in (bool, datetime) else quantity.sql[0]
        for quantity in quantities
    )
    return episodes_with(*columns).order_by(EpisodeRow.id)


_BATCH = 200
"""Rows alive at a time: the garbage collector traverses all of them repeatedly."""
_PART = 20_000
"""Episodes held as Python objects at a time, before conversion to NumPy arrays of a fifth of the size."""
_Codes = dict[str, dict[str | None, int]]
"""Name of a column of texts -> text -> its code, in the order in which the texts were read."""
_CODED = {"goal": (), "state": (COUNTED, UNJUDGED, VOID, SUPERSEDED, RUNNING), "end_reason": ()}
"""Columns of texts -> the categories; those that occur, in alphabetical order, if none are listed."""


def _read(connection: Connection, quantities: Fields, trials: Sequence[Any], codes: _Codes) -> dict[str, Any]:
    """Return columns of the episodes of some trials as arrays; texts as numbers, to which `codes` gets the key."""
    query = episodes_query(quantities).where(*trials)
    found = connection.execution_options(yield_per=_BATCH).execute(query)
    parts: list[list[Any]] = [[] for _ in quantities]
    columns: list[list[Any]] = [[] for _ in quantities]

    def convert() -> None:
        for quantity, part, values in zip(quantities, parts, columns, strict=True):
            decode = quantity.decode if len(quantity.sql) == 1 else None
            part.append(_typed(quantity, values if decode is None else [decode(value) for value in values], codes))
            values.clear()

    for rows in found.partitions():
        for column, values in zip(columns, zip(*rows, strict=True), strict=True):
            column.extend(values)
        if len(columns[0]) >= _PART:
            convert()
    convert()
    return {quantity.heading: np.concatenate(part) for quantity, part in zip(quantities, parts, strict=True)}


def _typed(quantity: Field, values: Sequence[Any], codes: _Codes) -> NDArray[Any]:
    """Convert the driver's values of a quantity at once, for speed."""
    if quantity.heading in _CODED:
        known = codes.setdefault(quantity.heading, {})
        for text in dict.fromkeys(values):
            known.setdefault(text, len(known))
        return np.fromiter(map(known.__getitem__, values), np.int64, len(values))
    if quantity.base is float:
        numbers = np.array(values, np.float64)
        return np.where(np.isfinite(numbers), numbers, np.nan)  # other writers may store infinities
    return np.array(values, {int: np.int64, bool: bool}.get(quantity.base, object))


def _whole(
    columns: dict[str, Any],
    codes: _Codes,
    conditions: Sequence[Condition],
    condition_of: Mapping[int, int],
    renamed: Mapping[tuple[int, str], str],
) -> EpisodeColumns:
    """Return what `_read` returned as the columns of `COLUMNS`, with the computed ones.

    `condition_of` has the numbers of the conditions by campaign, `renamed` goals' names in this report.
    """
    numbers, known, campaigns = columns["goal"], codes.setdefault("goal", {}), columns["campaign"]
    for (campaign, goal), name in renamed.items():
        if goal in known:
            numbers[(campaigns == campaign) & (numbers == known[goal])] = known.setdefault(name, len(known))
    present = np.unique(numbers).tolist()
    codes["goal"] = {goal: number for goal, number in known.items() if number in present}
    for name, categories in _CODED.items():
        columns[name] = _coded(columns[name], codes.get(name, {}), categories)
    own, places = np.unique(campaigns, return_inverse=True)
    columns["condition"] = np.array([condition_of[number] for number in own.tolist()], np.int64)[places]
    if stacks := [condition.number for condition in conditions if condition.execution == STACK]:
        columns["actions"] = np.where(np.isin(columns["condition"], stacks), np.nan, columns["actions"])
    columns["progress"] = progress_of(columns)
    columns["spl"] = spl_of(columns)
    columns["soft_spl"] = soft_spl_of(columns)
    add_times(columns, conditions)
    return EpisodeColumns(columns, np.arange(len(numbers)))


def _coded(numbers: Integers, codes: Mapping[str | None, int], categories: Sequence[str]) -> Codes:
    names = list(categories) or sorted(text for text in codes if text is not None)
    moved = np.full(max(codes.values(), default=-1) + 1, -1, np.int64)
    for place, name in enumerate(names):
        if name in codes:
            moved[codes[name]] = place
    return Codes(moved[numbers], names)


def _of_frame(name: str, values: Any) -> Any:
    """Return a column as it is in the DataFrame."""
    import pandas as pd

    if isinstance(values, Codes):
        return pd.Categorical.from_codes(values.numbers, pd.Index(list(values.names)))
    if name in ("started_at", "ended_at"):
        return pd.to_datetime(pd.Series(values, dtype=object), utc=True, format="ISO8601")
    return values


def _planned(
    connection: Connection,
    chosen: Selection,
    condition_of: Mapping[int, int],
    renamed: Mapping[tuple[int, str], str],
) -> Counter[tuple[int, str, int]]:
    rows = connection.execute(
        select(TrialRow.campaign_id, TrialRow.goal, TrialRow.start, func.count())
        .where(*trial_filter(chosen, condition_of))
        .group_by(TrialRow.campaign_id, TrialRow.goal, TrialRow.start)
    )
    planned: Counter[tuple[int, str, int]] = Counter()
    for campaign, goal, start, trials in rows:
        planned[condition_of[campaign], renamed.get((campaign, goal), goal), start] += trials
    return planned
