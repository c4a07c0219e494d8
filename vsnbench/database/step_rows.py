"""A step as a row of the record and back, and how one is appended while a robot drives.

The two statements of a step are put into the database's own words once: composed anew for every step, as all others
are, they cost more than the database itself, on a thread that competes with the model for the interpreter.
"""

import logging
import math
import sqlite3
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Self

from sqlalchemy import Dialect, Engine, bindparam, insert, update
from sqlalchemy.sql.dml import UpdateBase

from vsnbench.database.engine import transaction
from vsnbench.database.lifecycle import LEASE, EpisodeState, lease
from vsnbench.database.row_encoding import Row, fix_of_columns, number, pose_columns, pose_of_columns, text
from vsnbench.database.tables import Episode, Step
from vsnbench.protocol.actions import Action
from vsnbench.protocol.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.protocol.step_record import StepRecord, StepTimings

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class DriverStatement:
    """A statement in the words of one database's driver, with what turns values into those that it takes."""

    text: str
    order: tuple[str, ...] | None
    """The names of its parameters by their places; None where the driver takes them by name."""
    encoders: Mapping[str, Callable[[Any], Any]]
    given: Mapping[str, Any]
    """Parameters that are always the same."""

    @classmethod
    def of(cls, statement: UpdateBase, dialect: Dialect, columns: list[str] | None = None) -> Self:
        """Put a statement into the words of a database; `columns` are those that an INSERT fills in."""
        compiled = statement.compile(dialect=dialect, column_keys=columns)
        encoders = {
            name: encode
            for name, parameter in compiled.binds.items()
            if (encode := parameter.type.dialect_impl(dialect).bind_processor(dialect)) is not None
        }
        given = {
            name: encoders.get(name, _same)(parameter.effective_value)
            for name, parameter in compiled.binds.items()
            if not parameter.required
        }
        order = tuple(compiled.positiontup) if compiled.positiontup is not None else None
        return cls(str(compiled), order, encoders, given)

    def execute(self, run: Callable[[str, Any], Any], values: Row) -> int:
        """Have it carried out by what takes a statement and its parameters; return how many rows it has changed."""
        encoded = {**self.given, **values}
        for name, encode in self.encoders.items():
            if name in values:
                encoded[name] = encode(values[name])
        parameters = encoded if self.order is None else tuple(encoded[name] for name in self.order)
        return int(run(self.text, parameters).rowcount)


def _same(value: object) -> object:
    return value


class StepStatements:
    """Appends steps to episodes that run in one process."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._is_sqlite = engine.dialect.name == "sqlite"
        until = lease(engine)  # a server's own clock is a part of the statement
        self._tells_time = isinstance(until, datetime)
        self._sign_of_life = DriverStatement.of(
            update(Episode)
            .where(
                Episode.id == bindparam("episode"),
                Episode.process_id == bindparam("process"),
                Episode.end_reason.is_(None),
                Episode.state == EpisodeState.RUNNING.value,
            )
            .values(lease_until=bindparam("until") if self._tells_time else until),
            engine.dialect,
        )
        columns = [column.name for column in Step.__table__.columns]
        self._insert = DriverStatement.of(insert(Step).inline(), engine.dialect, columns)

    def append(self, process_id: int, row: Row) -> bool:
        """Commit a step's row, which is a sign of life of its episode; False, and nothing, where that runs elsewhere.

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
        with transaction(self._engine) as connection:
            return self._write(connection.exec_driver_sql, process_id, row)

    def _commit_with_driver(self, process_id: int, row: Row) -> bool:
        """Do it in a transaction of SQLite's own driver, which costs half of one of SQLAlchemy's."""
        pooled = self._engine.raw_connection()
        try:
            connection: Any = pooled.driver_connection
            connection.execute("BEGIN IMMEDIATE")
            try:
                written = self._write(connection.execute, process_id, row)
                connection.execute("COMMIT")
            except BaseException:
                connection.rollback()
                raise
            return written
        finally:
            pooled.close()

    def _write(self, run: Callable[[str, Any], Any], process_id: int, row: Row) -> bool:
        alive: Row = {"episode": row["episode_id"], "process": process_id}
        if self._tells_time:
            alive["until"] = datetime.now(UTC) + LEASE
        if self._sign_of_life.execute(run, alive) != 1:
            return False
        self._insert.execute(run, row)
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
