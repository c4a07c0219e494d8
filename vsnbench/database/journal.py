"""The one place that writes the record: campaigns, episodes, steps, verdicts, events; each committed as it happens."""

import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from types import TracebackType
from typing import Any, Self

from sqlalchemy import Connection, Engine, insert, select, update

from vsnbench.database.engine import open_engine, reading, record_errors
from vsnbench.database.migrate import upgrade
from vsnbench.database.provenance import Provenance, gather_provenance, this_process
from vsnbench.database.records import (
    CampaignPlan,
    CampaignRecord,
    EpisodeEnd,
    EpisodeHandle,
    EpisodeStart,
    RecoveredEpisode,
    StepRecord,
    TrialRecord,
)
from vsnbench.database.recovery import dead_episodes, interrupt
from vsnbench.database.rows import (
    Row,
    campaign_row,
    episode_end_row,
    episode_start_row,
    model_row,
    process_row,
    robot_row,
    site_row,
    step_row,
    text,
    verdict_row,
)
from vsnbench.database.tables import Base, Campaign, Episode, Event, Model, Process, Robot, Site, Step, Trial
from vsnbench.database.tables import Verdict as VerdictTable
from vsnbench.database.validity import counts, standing_verdict_id, takers
from vsnbench.errors import RecordError, TrialTakenError, UsageError
from vsnbench.protocol.judge import Verdict


def images_directory(episode_id: int) -> str:
    """Return where an episode's files lie, relative to the results directory."""
    return f"episodes/{episode_id:06d}"


class Journal:
    """An open record. Safe to use from several threads and processes; a context manager.

    Every method commits before it returns, and raises RecordError when the database cannot be used.
    """

    def __init__(self, engine: Engine, process_id: int, recovered: tuple[RecoveredEpisode, ...] = ()) -> None:
        self.engine = engine
        self._process_id = process_id
        self.recovered = recovered
        """What was found running without a process when the record was opened."""

    @classmethod
    def open(cls, url: str, provenance: Provenance | None = None) -> Self:
        """Open the database for writing; create and migrate it as needed, and close what dead processes left running.

        Args:
            url: any SQLAlchemy URL (`vsnbench.database.engine.sqlite_url` makes one of a path).
            provenance: who writes; gathered from this process when None.

        Raises:
            RecordError: it cannot be used, or it is from a newer vsnbench.
        """
        engine = open_engine(url)
        try:
            upgrade(engine)
            with _transaction(engine) as connection:
                process_id = _insert(connection, Process, process_row(provenance or gather_provenance()))
            journal = cls(engine, process_id)
            journal.recovered = journal.recover()
        except BaseException:
            engine.dispose()
            raise
        return journal

    def close(self) -> None:
        """Let go of the database."""
        self.engine.dispose()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def find_or_create_campaign(self, plan: CampaignPlan) -> CampaignRecord:
        """Return the campaign of an equal plan, or write a new one with all its trials."""
        key = plan.key
        with _transaction(self.engine) as connection:
            found = connection.execute(select(Campaign.id).where(Campaign.key == key)).scalar()
            campaign_id = self._create_campaign(connection, plan) if found is None else found
            campaign = connection.execute(
                select(Campaign.name, Campaign.created_at).where(Campaign.id == campaign_id)
            ).one()
            trials = connection.execute(
                select(Trial.id, Trial.goal, Trial.start, Trial.repetition, Trial.place)
                .where(Trial.campaign_id == campaign_id)
                .order_by(Trial.place)
            )
            return CampaignRecord(
                id=campaign_id,
                key=key,
                name=campaign.name,
                created_at=campaign.created_at,
                resumed=found is not None,
                trials=tuple(TrialRecord(*row) for row in trials),
            )

    def trials_left(self, campaign_id: int) -> tuple[TrialRecord, ...]:
        """Return the trials that nobody has done or is running, in the campaign's order."""
        with _transaction(reading(self.engine)) as connection:
            rows = connection.execute(
                select(Trial.id, Trial.goal, Trial.start, Trial.repetition, Trial.place)
                .where(Trial.campaign_id == campaign_id, ~takers(Trial.id).correlate(Trial).exists())
                .order_by(Trial.place)
            )
            return tuple(TrialRecord(*row) for row in rows)

    def outcomes(self, campaign_id: int) -> tuple[bool, ...]:
        """Return, for each trial that is done and judged, whether it succeeded."""
        with _transaction(reading(self.engine)) as connection:
            rows = connection.execute(
                select(VerdictTable.success)
                .select_from(Episode)
                .join(Trial, Trial.id == Episode.trial_id)
                .join(VerdictTable, VerdictTable.id == standing_verdict_id(Episode.id))
                .where(Trial.campaign_id == campaign_id, counts(Episode, VerdictTable))
            )
            return tuple(bool(success) for (success,) in rows)

    def begin_episode(self, start: EpisodeStart) -> EpisodeHandle:
        """Write a new episode of a trial.

        Raises:
            TrialTakenError: the trial is being run by another process, or an episode of it counts already.
        """
        identity = start.uuid or str(uuid.uuid4())
        with _transaction(self.engine) as connection:
            # On a server this row is the lock by which two robots do not take the same trial.
            connection.execute(select(Trial.id).where(Trial.id == start.trial_id).with_for_update()).one()
            other = connection.execute(takers(start.trial_id).limit(1)).first()
            if other is not None:
                state = "is running it" if other.end_reason is None else "counts for it"
                raise TrialTakenError(f"trial {start.trial_id} is taken: episode {other.id} {state}")
            row = {**episode_start_row(start), "uuid": identity, "process_id": self._process_id}
            episode_id = _insert(connection, Episode, row)
            directory = images_directory(episode_id) if start.keeps_images else ""
            if directory:
                connection.execute(update(Episode).where(Episode.id == episode_id).values(images_directory=directory))
        return EpisodeHandle(episode_id, identity, directory)

    def append_step(self, episode_id: int, step: StepRecord) -> None:
        """Write one step. Its images must be on disk before: then a committed step always has them."""
        row = step_row(episode_id, step)
        with _transaction(self.engine) as connection:
            connection.execute(_INSERT_STEP, row)

    def end_episode(self, episode_id: int, end: EpisodeEnd) -> None:
        """Write an episode's end and its verdict, both or neither.

        Raises:
            RecordError: it has ended already, for instance because another process took this one for dead.
        """
        with _transaction(self.engine) as connection:
            done = connection.execute(
                update(Episode)
                .where(Episode.id == episode_id, Episode.end_reason.is_(None))
                .values(**episode_end_row(end))
            )
            if done.rowcount != 1:
                raise RecordError(f"episode {episode_id} has ended already: its end was written by another process")
            if end.verdict is not None:
                row = verdict_row(episode_id, end.verdict, author="vsnbench", source="protocol")
                connection.execute(insert(VerdictTable), row)

    def add_verdict(self, episode_id: int, verdict: Verdict, *, author: str, source: str = "person") -> None:
        """Append a judgement to an ended episode; from now on it stands.

        Raises:
            UsageError: there is no such episode.
            RecordError: it is still running.
        """
        with _transaction(self.engine) as connection:
            row = connection.execute(select(Episode.end_reason).where(Episode.id == episode_id)).first()
            if row is None:
                raise UsageError(f"there is no episode {episode_id}: `vsnbench episodes list` shows them")
            if row.end_reason is None:
                raise RecordError(f"episode {episode_id} is still running: judge it when it has ended")
            connection.execute(insert(VerdictTable), verdict_row(episode_id, verdict, author=author, source=source))

    def add_event(
        self,
        kind: str,
        words: str,
        *,
        campaign_id: int | None = None,
        episode_id: int | None = None,
        step_number: int | None = None,
    ) -> None:
        """Write down something worth knowing that is not a step."""
        row = {"kind": kind, "text": text(words), "campaign_id": campaign_id, "episode_id": episode_id}
        with _transaction(self.engine) as connection:
            connection.execute(insert(Event), {**row, "step_number": step_number, "created_at": datetime.now(UTC)})

    def recover(self) -> tuple[RecoveredEpisode, ...]:
        """Close, as `interrupted`, the running episodes whose process is dead; their steps stay as they are."""
        here = this_process()
        with _transaction(reading(self.engine)) as connection:
            if not dead_episodes(connection, here):
                return ()
        with _transaction(self.engine) as connection:
            # Looked at again under the lock: another process may have closed them first.
            return tuple(interrupt(connection, row) for row in dead_episodes(connection, here))

    def _create_campaign(self, connection: Connection, plan: CampaignPlan) -> int:
        row = {
            **campaign_row(plan),
            "site_id": _find_or_insert(connection, Site, site_row(plan.site), ("sha256",)),
            "robot_id": _find_or_insert(connection, Robot, robot_row(plan.robot), ("sha256", "backend")),
            "model_id": _find_or_insert(connection, Model, model_row(plan.model), ("sha256",)),
            "process_id": self._process_id,
        }
        campaign_id = _insert(connection, Campaign, row)
        connection.execute(
            insert(Trial),
            [
                {
                    "campaign_id": campaign_id,
                    "place": place,
                    "goal": t.goal,
                    "start": t.start,
                    "repetition": t.repetition,
                }
                for place, t in enumerate(plan.trials)
            ],
        )
        return campaign_id


_INSERT_STEP = insert(Step)


@contextmanager
def _transaction(engine: Engine) -> Iterator[Connection]:
    with record_errors(engine), engine.begin() as connection:
        yield connection


def _insert(connection: Connection, table: type[Base], row: Row) -> int:
    key: Any = connection.execute(insert(table), row).inserted_primary_key
    return int(key[0])


def _find_or_insert(connection: Connection, table: type[Base], row: Row, unique: tuple[str, ...]) -> int:
    columns = table.__table__.c
    same = [columns[name] == row[name] for name in unique]
    found: int | None = connection.execute(select(columns.id).where(*same)).scalar()
    return _insert(connection, table, row) if found is None else found
