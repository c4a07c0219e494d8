"""A step as a row of the record and back, and how one is appended while a robot drives.

The statements of a step are put into the database's own words once: composed anew for every step, as all others are,
they cost more than the database itself, on a thread that competes with the model for the interpreter.
"""

import logging
import math
import sqlite3
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Self

from sqlalchemy import Dialect, Engine, PoolProxiedConnection, bindparam, insert, select, update
from sqlalchemy.sql.dml import UpdateBase

from vsnbench.database.engine import transaction
from vsnbench.database.lifecycle import LEASE, EpisodeState, lease
from vsnbench.database.row_encoding import Row, fix_of_columns, number, pose_columns, pose_of_columns, text
from vsnbench.database.tables import Episode, Step
from vsnbench.protocol.actions import Action
from vsnbench.protocol.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.protocol.step_record import StepRecord, StepTimings

logger = logging.getLogger(__name__)

RENEWED_AFTER = LEASE / 6
"""A step renews the lease of its episode where it was renewed longer ago."""


@dataclass(frozen=True, slots=True)
class DriverStatement:
    """A statement in the words of one database's driver, with what turns values into those that it takes."""

    text: str
    names: tuple[str, ...]
    """Of its parameters; by their places where the driver takes them so."""
    encoders: tuple[Callable[[Any], Any] | None, ...]
    """One for each name."""
    given: Mapping[str, Any]
    """Parameters that are always the same."""
    by_place: bool

    @classmethod
    def of(cls, statement: UpdateBase, dialect: Dialect, columns: list[str] | None = None) -> Self:
        """Put a statement into the words of a database; `columns` are those that an INSERT fills in."""
        compiled = statement.compile(dialect=dialect, column_keys=columns)
        encoders = {
            name: parameter.type.dialect_impl(dialect).bind_processor(dialect)
            for name, parameter in compiled.binds.items()
        }
        given = {name: one.effective_value for name, one in compiled.binds.items() if not one.required}
        names = tuple(compiled.binds) if compiled.positiontup is None else tuple(compiled.positiontup)
        return cls(
            str(compiled), names, tuple(encoders[name] for name in names), given, compiled.positiontup is not None
        )

    def execute(self, run: Callable[[str, Any], Any], values: Row) -> int:
        """Have it carried out by what takes a statement and its parameters; return how many rows it has changed."""
        values = {**self.given, **values}
        encoded = tuple(
            values[name] if encode is None else encode(values[name])
            for name, encode in zip(self.names, self.encoders, strict=True)
        )
        parameters = encoded if self.by_place else dict(zip(self.names, encoded, strict=True))
        return int(run(self.text, parameters).rowcount)


class StepStatements:
    """Appends steps to episodes that run in one process."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._is_sqlite = engine.dialect.name == "sqlite"
        until = lease(engine)  # a server's own clock is a part of the statement
        self._tells_time = isinstance(until, datetime)
        runs_here = (
            Episode.id == bindparam("episode_id"),
            Episode.process_id == bindparam("process"),
            Episode.end_reason.is_(None),
            Episode.state == EpisodeState.RUNNING.value,
        )
        sign = update(Episode).where(*runs_here).values(lease_until=bindparam("until") if self._tells_time else until)
        self._sign_of_life = DriverStatement.of(sign, engine.dialect)
        columns = Step.__table__.columns
        names = [column.name for column in columns]
        self._insert = DriverStatement.of(insert(Step).inline(), engine.dialect, names)
        row = select(*(bindparam(column.name, type_=column.type) for column in columns))
        running = select(Episode.id).where(*runs_here)
        self._insert_where_it_runs = DriverStatement.of(
            insert(Step).from_select(names, row.where(running.exists())), engine.dialect
        )
        self._one_at_a_time = threading.Lock()
        self._pooled: PoolProxiedConnection | None = None
        self._alive: tuple[int, datetime] | None = None
        """The episode whose last sign of life was shown here, and until when its lease was renewed by it."""

    def append(self, process_id: int, row: Row) -> bool:
        """Commit a step's row; False, and nothing, where its episode runs elsewhere.

        It is a sign of life of the episode, whose lease is renewed where a part of it has passed.

        Args:
            process_id: whose episode it has to be.
            row: as `step_row` makes it.

        Raises:
            RecordError: the database could not be used.
        """
        if self._is_sqlite:
            try:
                return self._commit_with_driver(process_id, row)
            except sqlite3.Error as error:
                # Nothing was written: the usual way waits for a lock, and says what is wrong.
                logger.debug("step %s again, the usual way: %s", row["number"], error)
                self.let_go()
        with transaction(self._engine) as connection:
            return self._write(connection.exec_driver_sql, process_id, row)

    def let_go(self) -> None:
        """Give the connection back that is held from one step to the next; the next step takes another."""
        with self._one_at_a_time:
            pooled, self._pooled = self._pooled, None
            if pooled is not None:
                pooled.close()

    def _commit_with_driver(self, process_id: int, row: Row) -> bool:
        """Do it in a transaction of SQLite's own driver, which costs half of one of SQLAlchemy's."""
        with self._one_at_a_time:
            self._pooled = self._pooled or self._engine.raw_connection()
            connection: Any = self._pooled.driver_connection
            if self._was_just_alive(row["episode_id"]):  # a statement by itself is a transaction
                values = {**row, "process": process_id}
                return self._insert_where_it_runs.execute(connection.execute, values) == 1
            connection.execute("BEGIN IMMEDIATE")
            try:
                written = self._write(connection.execute, process_id, row)
                connection.execute("COMMIT")
            except BaseException:
                connection.rollback()
                raise
            return written

    def _was_just_alive(self, episode_id: int) -> bool:
        """Whether hardly any of an episode's lease has passed, by the same clock as others look at."""
        if self._alive is None or self._alive[0] != episode_id:
            return False
        return LEASE - RENEWED_AFTER < self._alive[1] - datetime.now(UTC) <= LEASE

    def _write(self, run: Callable[[str, Any], Any], process_id: int, row: Row) -> bool:
        until = datetime.now(UTC) + LEASE
        alive: Row = {"episode_id": row["episode_id"], "process": process_id}
        if self._tells_time:
            alive["until"] = until
        if self._sign_of_life.execute(run, alive) != 1:
            return False
        self._insert.execute(run, row)
        self._alive = (row["episode_id"], until)
        return True


def step_row(episode_id: int, step: StepRecord) -> Row:
    """Return the row of a step; one that the guard refused ends where it began."""
    result = step.result
    collision = result.collision if result else None
    return {
        "episode_id": episode_id,
        "number": step.number,
        "raw_action": text(step.raw_action) or step.action.value,
        "action": step.action.value,
        "blocked": step.blocked,
        "completed": result is not None and result.completed,
        "failure": text(result.failure) if result else "",
        "recorded_at": step.recorded_at or datetime.now(UTC),
        "stamp_s": number(step.stamp_s),
        **pose_columns("observed", step.observed),
        **pose_columns("after", step.after),
        **pose_columns("world", step.world.pose if step.world else None),
        "world_source": step.world.source.value if step.world else None,
        "displacement_m": number(result.displacement_m) if result else 0.0,
        "turn_rad": number(result.turn_rad) if result else 0.0,
        "duration_s": number(result.duration_s) if result else 0.0,
        "corrections": result.corrections if result else 0,
        "collision_source": collision.source.value if collision else None,
        "collision_touched": text(collision.touched) if collision else None,
        "rgb_digest": step.rgb_digest,
        "depth_digest": step.depth_digest,
        "sense_s": number(step.timings.sense_s),
        "infer_s": number(step.timings.infer_s),
        "move_s": number(step.timings.move_s),
        "probabilities": dict(step.probabilities) or None,
        "details": dict(step.details) or None,
    }


def step_of_row(row: Any) -> StepRecord:
    """Return the step of a row, as it was handed to `step_row`.

    Raises:
        ValueError: the row holds what no step has.
    """
    result = None
    if not row.blocked:
        collision = None
        if row.collision_source is not None:
            collision = Collision(CollisionSource(row.collision_source), row.collision_touched or "")
        result = MotionResult(
            completed=row.completed,
            displacement_m=_known(row.displacement_m),
            turn_rad=_known(row.turn_rad),
            duration_s=_known(row.duration_s),
            collision=collision,
            failure=row.failure,
            corrections=row.corrections,
            pose=pose_of_columns(row.after_x_m, row.after_y_m, row.after_heading_rad),
        )
    return StepRecord(
        number=row.number,
        action=Action(row.action),
        raw_action=row.raw_action,
        result=result,
        observed=pose_of_columns(row.observed_x_m, row.observed_y_m, row.observed_heading_rad),
        stamp_s=row.stamp_s,
        world=fix_of_columns(row.world_x_m, row.world_y_m, row.world_heading_rad, row.world_source),
        rgb_digest=row.rgb_digest,
        depth_digest=row.depth_digest,
        timings=StepTimings(row.sense_s, row.infer_s, row.move_s),
        probabilities=row.probabilities or {},
        details=row.details or {},
        recorded_at=row.recorded_at,
    )


def _known(value: float | None) -> float:
    return math.nan if value is None else value
