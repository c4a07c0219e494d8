"""Reads a record into memory once, an episode a row; every table and figure is a view of this.

A row is 200 bytes or so: the 10 million steps of a large record stay in the database, where they are counted.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeAlias

from sqlalchemy import Connection, Engine, Select, func, select, type_coerce
from sqlalchemy.types import NullType

from vsnbench.database.engine import record_errors
from vsnbench.database.read_model import (
    COUNTED,
    DISTANCE_M,
    END_REASON,
    GOAL_IN_SIGHT,
    PART,
    RUNNING,
    SUCCESS,
    SUPERSEDED,
    UNJUDGED,
    VOID,
    episodes_of_trials,
)
from vsnbench.database.tables import Episode, Site, Trial
from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.report.conditions import Condition, read_conditions

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    Integers: TypeAlias = NDArray[np.integer[Any]]
    Floats: TypeAlias = NDArray[np.float64]
    Rows: TypeAlias = NDArray[np.bool_] | Integers | slice

COLUMNS: dict[str, str] = {
    "episode": "number of the episode",
    "condition": "number of the condition, see `Record.conditions`",
    "campaign": "number of the campaign",
    "process": "number of the process that ran it",
    "session": "number of the session that it was run in; 0 where nobody stood beside the robot",
    "trial": "number of the trial",
    "goal": "goal category",
    "start": "number of the starting position",
    "repetition": "from 1",
    "state": "counted, unjudged, void, superseded or running",
    "end_reason": "after the standing verdict; None while running",
    "success": "of the standing verdict; False where there is none",
    "actions": "actions of the policy, STOP and blocked ones included",
    "path_length_m": "length of the path driven; NaN when unknown",
    "shortest_m": "geodesic distance from the start to the goal; NaN when unknown",
    "remaining_m": "geodesic distance from the end to the goal; NaN when unknown",
    "distance_m": "distance to the goal of the standing verdict; NaN when unknown",
    "goal_in_sight": "whether an instance was in sight where it ended; True where the rule did not ask",
    "duration_s": "on the robot's clock; NaN when unknown",
    "wall_duration_s": "wall time; NaN when unknown",
    "spl": "success weighted by path length: 0 for a failure, NaN for a success of unknown length",
    "soft_spl": "the same with progress in place of success; NaN where a length is unknown",
    "started_at": "aware, UTC",
    "ended_at": "aware, UTC; NaT while running",
    "images_directory": "relative to the results directory; empty for none",
}
"""Columns of `Record.episodes` and what they hold."""


@dataclass(frozen=True, slots=True)
class Selection:
    """Which part of the record a report is about; an empty field takes everything."""

    models: Sequence[str] = ()
    goals: Sequence[str] = ()
    sites: Sequence[str] = ()
    robots: Sequence[str] = ()
    campaigns: Sequence[int] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """What a report is made of."""

    conditions: tuple[Condition, ...]
    episodes: "pd.DataFrame"
    """One row an episode; the columns are those of `COLUMNS`."""
    planned: "pd.DataFrame"
    """Trials planned: condition, goal, start, trials."""
    sites: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """SHA-256 of a site -> its content."""
    results_directory: Path | None = None

    def of(self, condition: Condition) -> "pd.DataFrame":
        """Return the episodes of one condition."""
        return self.episodes[self.episodes["condition"] == condition.number]

    def counted(self, condition: Condition | None = None) -> "pd.DataFrame":
        """Return the episodes that count, of one condition or of all."""
        rows = self.episodes if condition is None else self.of(condition)
        return rows[rows["state"] == COUNTED]


@dataclass(frozen=True, slots=True, eq=False)
class Codes:
    """A categorical column as small numbers."""

    numbers: "Integers"
    names: Sequence[str]

    def of(self, *names: str) -> "NDArray[np.bool_]":
        """Return which rows have one of these values."""
        import numpy as np

        found = np.zeros(len(self.numbers), bool)
        for name in names:
            if name in self.names:
                found |= self.numbers == self.names.index(name)
        return found

    def __getitem__(self, rows: "Rows") -> "Codes":
        return Codes(self.numbers[rows], self.names)


@dataclass(frozen=True, slots=True, eq=False)
class EpisodeColumns:
    """Columns of `Record.episodes`, an entry an episode; units are those of the names."""

    episode: "Integers"
    condition: "Integers"
    goal: Codes
    start: "Integers"
    state: Codes
    end_reason: Codes
    success: "NDArray[np.bool_]"
    actions: "Integers"
    spl: "Floats"
    soft_spl: "Floats"
    distance_m: "Floats"
    shortest_m: "Floats"

    @classmethod
    def of(cls, episodes: "pd.DataFrame") -> Self:
        """Return the columns of rows of `Record.episodes`."""

        def column(name: str) -> Any:
            values = episodes[name]
            if name in ("goal", "state", "end_reason"):
                return Codes(values.cat.codes.to_numpy(), list(values.cat.categories))
            return values.to_numpy()

        return cls(*(column(name) for name in cls.__slots__))

    def __getitem__(self, rows: "Rows") -> Self:
        return type(self)(*(getattr(self, name)[rows] for name in self.__slots__))

    def by(self, numbers: "Integers") -> "Iterator[tuple[int, EpisodeColumns]]":
        """Yield each number and its episodes, in the order of the rows.

        Args:
            numbers: (episodes,) what to group by.
        """
        import numpy as np

        order = np.argsort(numbers, kind="stable")
        values, begins = np.unique(numbers[order], return_index=True)
        for value, rows in zip(values.tolist(), np.split(order, begins[1:]), strict=False):
            yield value, self[rows]


def empty_record() -> Record:
    """Return a record with nothing in it: for the published numbers, which have no episodes."""
    import pandas as pd

    episodes = _whole(_typed(dict.fromkeys(_READ, ())), {})
    return Record((), episodes, pd.DataFrame(columns=["condition", "goal", "start", "trials"]))


def goal_order(goal: str) -> tuple[int, str]:
    """Sort key: the order of the paper's tables, then the alphabet."""
    return (GOAL_CATEGORIES.index(goal) if goal in GOAL_CATEGORIES else len(GOAL_CATEGORIES), goal)


def read_record(engine: Engine, selection: Selection | None = None, results_directory: Path | None = None) -> Record:
    """Read what a report needs.

    Raises:
        RecordError: the database cannot be used.
    """
    chosen = selection or Selection()
    with record_errors(engine), engine.connect() as connection:
        conditions, condition_of = read_conditions(connection, chosen)
        episodes = _episodes(connection, chosen, condition_of)
        planned = _planned(connection, chosen, condition_of)
        hashes = {condition.site_sha256 for condition in conditions}
        rows = connection.execute(select(Site.sha256, Site.content).where(Site.sha256.in_(hashes)))
        sites: dict[str, Mapping[str, Any]] = {row.sha256: row.content for row in rows}
    return Record(conditions, episodes, planned, sites, results_directory)


def trial_filter(chosen: Selection, condition_of: Mapping[int, int]) -> list[Any]:
    """Return the conditions that the trials of a selection fulfil."""
    # Where every campaign is wanted, no index is to find them (hence + 0): it would bring the episodes in another
    # order than that of the table, and sorting them takes longer than reading them.
    some = chosen.models or chosen.sites or chosen.robots or chosen.campaigns
    campaign = Trial.campaign_id if some else Trial.campaign_id + 0
    wanted: list[Any] = [campaign.in_(list(condition_of))]
    if chosen.goals:
        wanted.append(Trial.goal.in_(chosen.goals))
    return wanted


def episodes_query() -> Select[Any]:
    """Select every episode with its trial and its standing verdict, in the order of their numbers."""
    return episodes_of_trials(
        Episode.id,
        Trial.campaign_id,
        Episode.process_id,
        type_coerce(func.coalesce(Episode.session_id, 0), NullType()),
        Trial.id,
        Trial.goal,
        Trial.start,
        Trial.repetition,
        PART,
        END_REASON,
        type_coerce(func.coalesce(SUCCESS, False), NullType()),
        Episode.actions,
        Episode.path_length_m,
        Episode.geodesic_start_m,
        Episode.geodesic_end_m,
        DISTANCE_M,
        type_coerce(GOAL_IN_SIGHT, NullType()),
        Episode.duration_s,
        Episode.wall_duration_s,
        # As the driver gives it: pandas reads 200,000 times at once, SQLAlchemy would one by one.
        type_coerce(Episode.started_at, NullType()),
        type_coerce(Episode.ended_at, NullType()),
        Episode.images_directory,
    ).order_by(Episode.id)


_READ = (
    *("episode", "campaign", "process", "session", "trial", "goal", "start", "repetition", "state"),
    *("end_reason", "success", "actions"),
    *("path_length_m", "shortest_m", "remaining_m", "distance_m", "goal_in_sight"),
    *("duration_s", "wall_duration_s", "started_at", "ended_at", "images_directory"),
)
"""The columns of `episodes_query`, in its order."""
_BATCH = 200
"""Rows that are alive at once: the collector of garbage walks through all of them, again and again."""
_PART = 20_000
"""Episodes whose columns are numbers of Python's own at once; then they are numpy's, a fifth as large."""


def _episodes(connection: Connection, chosen: Selection, condition_of: Mapping[int, int]) -> "pd.DataFrame":
    import pandas as pd

    query = episodes_query().where(*trial_filter(chosen, condition_of))
    found = connection.execution_options(yield_per=_BATCH).execute(query)
    parts: list[pd.DataFrame] = []
    columns: list[list[Any]] = [[] for _ in _READ]
    for rows in found.partitions():
        for column, values in zip(columns, zip(*rows, strict=True), strict=True):
            column.extend(values)
        if len(columns[0]) >= _PART:
            parts.append(_typed(dict(zip(_READ, columns, strict=True))))
            columns = [[] for _ in _READ]
    parts.append(_typed(dict(zip(_READ, columns, strict=True))))
    frame = pd.concat(parts, ignore_index=True)
    return _whole(frame, condition_of)


def _whole(frame: "pd.DataFrame", condition_of: Mapping[int, int]) -> "pd.DataFrame":
    """Return what was read with the columns that follow from it, in the order and with the types of `COLUMNS`."""
    import numpy as np
    import pandas as pd

    for name in ("goal", "end_reason"):
        frame[name] = frame[name].astype("category")
    frame["state"] = pd.Categorical(frame["state"], categories=[COUNTED, UNJUDGED, VOID, SUPERSEDED, RUNNING])
    frame.insert(1, "condition", frame["campaign"].map(dict(condition_of)).astype(np.int64))
    frame["spl"] = spl_of(frame)
    frame["soft_spl"] = soft_spl_of(frame)
    return frame[list(COLUMNS)]


def _typed(columns: Mapping[str, Sequence[Any]]) -> "pd.DataFrame":
    """Return columns as a driver gives them with the types of `COLUMNS`; a column at a time, which is the fast way."""
    import numpy as np
    import pandas as pd

    typed: dict[str, Any] = {}
    for name, values in columns.items():
        if name in ("episode", "campaign", "process", "session", "trial", "start", "repetition", "actions"):
            typed[name] = np.array(values, np.int64)
        elif name.endswith(("_m", "_s")):
            numbers = np.array(values, np.float64)
            typed[name] = np.where(np.isfinite(numbers), numbers, np.nan)  # one written elsewhere may hold infinities
        elif name.endswith("_at"):
            typed[name] = pd.to_datetime(pd.Series(values, dtype=object), utc=True, format="ISO8601")
        else:
            typed[name] = np.array(values, bool if name in ("success", "goal_in_sight") else object)
    return pd.DataFrame(typed)


def spl_of(frame: "pd.DataFrame") -> "pd.Series[float]":
    """Return `vsnbench.protocol.metrics.spl` of every row at once; a failure is 0 whatever its lengths."""
    efficiency = _efficiency(frame)
    return efficiency.where(frame["success"], 0.0)


def soft_spl_of(frame: "pd.DataFrame") -> "pd.Series[float]":
    """Return `vsnbench.protocol.metrics.soft_spl` of every row at once."""
    shortest, remaining = frame["shortest_m"], frame["remaining_m"]
    moved = (1.0 - remaining / shortest.where(shortest > 0)).clip(0.0, 1.0)
    there = (remaining <= 0).astype(float)  # the start was at the goal already
    progress = moved.where(shortest > 0, there).where(remaining.notna() & shortest.notna())
    return progress * _efficiency(frame)


def _efficiency(frame: "pd.DataFrame") -> "pd.Series[float]":
    shortest, path = frame["shortest_m"], frame["path_length_m"]
    longest = shortest.where(shortest >= path, path)
    ratio = (shortest / longest.where(longest > 0)).where(longest > 0, 1.0)
    return ratio.where(shortest.notna() & path.notna())


def _planned(connection: Connection, chosen: Selection, condition_of: Mapping[int, int]) -> "pd.DataFrame":
    import numpy as np
    import pandas as pd

    rows = connection.execute(
        select(Trial.campaign_id, Trial.goal, Trial.start, func.count())
        .where(*trial_filter(chosen, condition_of))
        .group_by(Trial.campaign_id, Trial.goal, Trial.start)
    ).all()
    frame = pd.DataFrame([tuple(row) for row in rows], columns=["campaign", "goal", "start", "trials"])
    frame["condition"] = frame["campaign"].map(dict(condition_of)).astype(np.int64)
    grouped = frame.groupby(["condition", "goal", "start"], observed=True)["trials"].sum().reset_index()
    for name in ("start", "trials"):
        grouped[name] = grouped[name].astype(np.int64)
    return grouped
