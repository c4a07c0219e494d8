"""Converts steps to rows and back, and appends them quickly while a robot drives.

The statements of a step are compiled once. Compiling them for every step would cost more than executing
them, on a thread that competes with the model for the interpreter.
"""

import logging
import math
import sqlite3
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any, Self

from sqlalchemy import (
    Dialect,
    Engine,
    PoolProxiedConnection,
    bindparam,
    case,
    func,
    insert,
    select,
    update,
)
from sqlalchemy.sql.dml import UpdateBase

from vsnbench.results.schema.engine import transaction
from vsnbench.results.schema.row_encoding import Row, fix_of_columns, number, pose_columns, pose_of_columns, text
from vsnbench.results.schema.tables import EpisodeRow, StepRow
from vsnbench.results.writing.lifecycle import LEASE, EpisodeState, lease
from vsnbench.values.encoding.codec import movement_from_json
from vsnbench.values.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.values.movement import Action, Movement
from vsnbench.values.step import AnswerTiming, StepRecord, StepTimings

logger = logging.getLogger(__name__)

RENEWED_AFTER = LEASE / 6
"""A step renews the lease of its episode if the last renewal is older than this."""


@dataclass(frozen=True, slots=True)
class DriverStatement:
    """A statement compiled for a database driver, with the encoders of its parameters."""

    text: str
    names: tuple[str, ...]
    """Names of the parameters, in order for drivers with positional parameters."""
    encoders: tuple[Callable[[Any], Any] | None, ...]
    """Encoder of each parameter."""
    given: Mapping[str, Any]
    """Constant parameters."""
    by_place: bool

    @classmethod
    def of(cls, statement: UpdateBase, dialect: Dialect, columns: list[str] | None = None) -> Self:
        """Compile a statement for a database; `columns` are the columns of an INSERT."""
        compiled = statement.compile(dialect=dialect, column_keys=columns)
        encoders = {
            name: parameter.type.dialect_impl(dialect).bind_processor(dialect)
            for name, parameter in compiled.binds.items()
        }
        given = {
            name: parameter.effective_value for name, parameter in compiled.binds.items() if not parameter.required
        }
        names = tuple(compiled.binds) if compiled.positiontup is None else tuple(compiled.positiontup)
        return cls(
            str(compiled), names, tuple(encoders[name] for name in names), given, compiled.positiontup is not None
        )

    def execute(self, run: Callable[[str, Any], Any], values: Row) -> int:
        """Execute it through `run`, which takes a statement and parameters; return the number of changed rows."""
        values = {**self.given, **values}
        encoded = tuple(
            values[name] if encode is None else encode(values[name])
            for name, encode in zip(self.names, self.encoders, strict=True)
        )
        parameters = encoded if self.by_place else dict(zip(self.names, encoded, strict=True))
        return int(run(self.text, parameters).rowcount)


class StepStatements:
    """Appends steps to the running episodes of one process."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._is_sqlite = engine.dialect.name == "sqlite"
        self._tells_time = isinstance(lease(engine.dialect), datetime)  # on a server an expression of the statement
        self._sign_of_life, self._insert, self._insert_where_it_runs = _compiled(engine.dialect)
        self._one_at_a_time = threading.Lock()
        self._pooled: PoolProxiedConnection | None = None
        self._alive: tuple[int, datetime] | None = None
        """Last episode whose lease was renewed here, and the end of that lease."""

    def append(self, process_id: int, row: Row) -> bool:
        """Commit a step's row; returns False without writing if the episode runs elsewhere.

        The lease of the episode is renewed if a part of it has passed.

        Raises:
            RecordError: the database cannot be used.
        """
        if self._is_sqlite:
            try:
                return self._commit_with_driver(process_id, row)
            except sqlite3.Error as error:
                # Nothing was written: the slow path waits for locks and reports errors.
                logger.debug("step %s is retried on the slow path: %s", row["number"], error)
                self.close_connection()
        with transaction(self._engine) as connection:
            return self._write(connection.exec_driver_sql, process_id, row)

    def close_connection(self) -> None:
        """Release the connection held between steps; the next step opens another."""
        with self._one_at_a_time:
            pooled, self._pooled = self._pooled, None
            if pooled is not None:
                pooled.close()

    def _commit_with_driver(self, process_id: int, row: Row) -> bool:
        """Commit with SQLite's own driver, at half the cost of SQLAlchemy."""
        with self._one_at_a_time:
            self._pooled = self._pooled or self._engine.raw_connection()
            connection: Any = self._pooled.driver_connection
            if self._lease_is_fresh(row["episode_id"]):  # a single statement is a transaction
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

    def _lease_is_fresh(self, episode_id: int) -> bool:
        """Whether the lease of an episode was renewed recently, by the clock used for leases."""
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


@lru_cache(maxsize=8)
def _compiled(dialect: Dialect) -> tuple[DriverStatement, DriverStatement, DriverStatement]:
    """Compile the sign of life of an episode, the insertion of a step, and the latter if the episode runs."""
    until = lease(dialect)
    runs_here = (
        EpisodeRow.id == bindparam("episode_id"),
        EpisodeRow.process_id == bindparam("process"),
        EpisodeRow.end_reason.is_(None),
        EpisodeRow.state == EpisodeState.RUNNING.value,
    )
    sign = update(EpisodeRow).where(*runs_here)
    sign = sign.values(lease_until=bindparam("until") if isinstance(until, datetime) else until)
    columns = StepRow.__table__.columns
    names = [column.name for column in columns]
    row = select(*(bindparam(column.name, type_=column.type) for column in columns))
    running = select(EpisodeRow.id).where(*runs_here)
    guarded = insert(StepRow).from_select(names, row.where(running.exists()))
    return (
        DriverStatement.of(sign, dialect),
        DriverStatement.of(insert(StepRow).inline(), dialect, names),
        DriverStatement.of(guarded, dialect),
    )


def step_row(episode_id: int, step: StepRecord) -> Row:
    """Return the row of a step; a blocked step ends where it began."""
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
        "rgb_file_digest": step.rgb_file_digest,
        "depth_file_digest": step.depth_file_digest,
        "sense_s": number(step.timings.sense_s),
        "infer_s": number(step.timings.infer_s),
        "move_s": number(step.timings.move_s),
        "probabilities": dict(step.probabilities) or None,
        "details": dict(step.details) or None,
        "movement": _movement_json(step),
        "refusal": text(step.refusal or (result.blocked if result else "")),
    }


THINKING_S = (
    select(case((func.count(StepRow.infer_s) == func.count(), func.sum(StepRow.infer_s))))
    .where(StepRow.episode_id == bindparam("episode"))
    .scalar_subquery()
)
"""Sum of the inference times of the steps of the episode `episode`; NULL if a step has none."""


def _movement_json(step: StepRecord) -> dict[str, Any] | None:
    """Return the JSON of a step's movement, of its place in a chunk and of its times; None for a discrete action."""
    content = {} if step.movement is None else step.movement.to_json()
    if step.part is not None:
        content["part"] = list(step.part)
    if step.result is not None and step.result.path_m is not None:
        content["path_m"] = number(step.result.path_m)
    if step.result is not None and step.result.waiting_s is not None:
        content["waiting_s"] = number(step.result.waiting_s)
    if step.answer is not None:
        content["answer"] = asdict(step.answer)
    return content or None


def step_of_row(row: Any) -> StepRecord:
    """Return the step of a row.

    Raises:
        ValueError: the row has invalid values.
    """
    result = None
    driven = _Driven.of(row.movement)
    if not row.blocked or driven.path_m is not None:  # a movement that the guard ended has a result
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
            blocked=row.refusal,
            path_m=driven.path_m,
            waiting_s=driven.waiting_s,
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
        rgb_file_digest=row.rgb_file_digest,
        depth_file_digest=row.depth_file_digest,
        timings=StepTimings(row.sense_s, row.infer_s, row.move_s),
        probabilities=row.probabilities or {},
        details=row.details or {},
        recorded_at=row.recorded_at,
        movement=driven.movement,
        part=driven.part,
        answer=driven.answer,
        refusal=row.refusal,
    )


@dataclass(frozen=True, slots=True)
class _Driven:
    """Content of a `movement` column."""

    movement: Movement | None = None
    part: tuple[int, int] | None = None
    path_m: float | None = None
    waiting_s: float | None = None
    answer: AnswerTiming | None = None

    @classmethod
    def of(cls, content: Any) -> Self:
        """Read a column.

        Raises:
            ValueError: it has invalid values.
        """
        if content is None:
            return cls()
        try:
            return cls(
                movement_from_json(content) if "kind" in content else None,
                (int(content["part"][0]), int(content["part"][1])) if "part" in content else None,
                _float(content.get("path_m")),
                _float(content.get("waiting_s")),
                AnswerTiming(**content["answer"]) if "answer" in content else None,
            )
        except (TypeError, IndexError, AttributeError) as error:
            raise ValueError(f"invalid movement: {error}") from error


def _known(value: float | None) -> float:
    return math.nan if value is None else value


def _float(value: Any) -> float | None:
    return None if value is None else float(value)
