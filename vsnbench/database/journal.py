"""The one place that writes the record: campaigns, episodes, steps, verdicts, events; each committed as it happens."""

from collections.abc import Collection, Sequence
from datetime import UTC, datetime
from types import TracebackType
from typing import Self

from sqlalchemy import Engine, insert

from vsnbench.database import studies
from vsnbench.database.campaign_plan import CampaignPlan, CampaignWriter, ModelIdentity, OpenCampaign
from vsnbench.database.engine import LockPatience, open_engine, reading, transaction
from vsnbench.database.episode_entries import RecoveredEpisode
from vsnbench.database.episodes import EpisodeWriter
from vsnbench.database.importing import ImportedEpisode, KeepFiles, import_episodes, withdraw
from vsnbench.database.merge_plan import MergePlan, OtherRecord, plan_merge
from vsnbench.database.merging import PlaceFiles, carry_out, lock_merges
from vsnbench.database.migrate import begin_record, upgrade
from vsnbench.database.model_history import differences, last_of_its_name
from vsnbench.database.provenance import Provenance, gather_provenance, this_process
from vsnbench.database.recovery import dead_episodes, dead_sessions, interrupted, recover_one
from vsnbench.database.row_encoding import insert_row, process_row, text
from vsnbench.database.sealed import SealedRows, keep_sealed
from vsnbench.database.sessions import attend, end_session_of_the_dead, end_sessions
from vsnbench.database.study_entries import RecordedStudy, StudyChange, StudyLock, StudyTrialStanding
from vsnbench.database.study_queries import read_study, session_of_another, study_standing
from vsnbench.database.tables import Event, Process
from vsnbench.errors import RecordError


class Journal(CampaignWriter, EpisodeWriter):
    """An open record. Safe to use from several threads and processes; a context manager.

    Every method commits before it returns, and raises RecordError when the database cannot be used.
    """

    def __init__(
        self,
        engine: Engine,
        process_id: int,
        recovered: tuple[RecoveredEpisode, ...] = (),
        patience: LockPatience | None = None,
    ) -> None:
        self.engine = engine
        self.patience = patience or LockPatience()
        """How long every method waits while another process has locked an SQLite file."""
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
        patience = LockPatience()
        begin_record(url)
        engine = open_engine(url, patience=patience)
        try:
            upgrade(engine)
            with transaction(engine) as connection:
                process_id = insert_row(connection, Process, process_row(provenance or gather_provenance()))
            journal = cls(engine, process_id, patience=patience)
            journal.recovered = journal.recover()
        except BaseException:
            engine.dispose()
            raise
        return journal

    def close(self) -> None:
        """Let go of the database."""
        self._steps.let_go()
        self.engine.dispose()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def model_change(self, campaign: OpenCampaign, model: ModelIdentity) -> str:
        """Say what makes the model of a campaign that is new another one than the last of its name; empty for nothing.

        Args:
            campaign: as it was opened.
            model: the plan's.
        """
        if campaign.resumed:
            return ""
        with transaction(reading(self.engine)) as connection:
            last = last_of_its_name(connection, text(model.name), campaign.id)
        found = differences(last[1], model) if last else ()
        return f"model {model.name} is not that of campaign {last[0]}: {', '.join(found)}" if last and found else ""

    def keep_sealed(self, episode_id: int, sealed: SealedRows) -> None:
        """Write the steps, events and end of an episode that a worker without this record has run: all, or nothing.

        It has been placed and begun here before, where it could begin, and its files are on disk.

        Raises:
            EpisodeClosedError: the episode is this process's no more; nothing was added.
        """
        with transaction(self.engine) as connection:
            keep_sealed(connection, self._process_id, episode_id, sealed)

    def import_campaign(
        self, plan: CampaignPlan, episodes: Sequence[ImportedEpisode], keep_files: KeepFiles | None = None
    ) -> tuple[int, tuple[int, ...]]:
        """Write another tool's episodes, one for each trial of the plan: all of them or none.

        Args:
            plan: of the campaign that they make.
            episodes: what the tool said, in the order of the plan's trials.
            keep_files: called for each episode with its place in the sequence and its directory, relative to the
                results directory; it puts the episode's images there before anything is committed.

        Returns:
            The campaign's number and the episodes'.

        Raises:
            UsageError: a trial of the plan has an episode already that is not void.
        """
        with transaction(self.engine) as connection:
            return import_episodes(connection, self._process_id, plan, episodes, keep_files)

    def withdraw_import(self, campaign_id: int, *, author: str, note: str = "") -> int:
        """Make every episode of an imported campaign void, and return how many they were; the same can come again.

        Raises:
            UsageError: there is no such campaign, or it was run here.
        """
        with transaction(self.engine) as connection:
            return withdraw(connection, campaign_id, author=author, note=note)

    def merge(
        self, others: Sequence[OtherRecord], expected: Collection[str], with_files: Collection[str], place: PlaceFiles
    ) -> MergePlan:
        """Take in what other records have and this one lacks: all of it or nothing.

        Args:
            others: the other records, as `expected` was read from them.
            expected: UUIDs of the episodes that are to come in.
            with_files: of these, the episodes whose files come along.
            place: called for each of them; it puts the files where they belong before anything is committed.

        Raises:
            RecordError: the records contradict each other, or this one was changed since `expected` was read.
        """
        with transaction(self.engine) as connection:
            lock_merges(connection)
            plan = plan_merge(connection, others, thorough=False)
            if {arrival.uuid for arrival in plan.arrivals} != set(expected):
                raise RecordError(
                    "another merge came between", advice="nothing was written; run the same command again"
                )
            carry_out(connection, others, plan, with_files, place)
            return plan

    def add_event(
        self,
        kind: str,
        words: str,
        *,
        author: str = "",
        campaign_id: int | None = None,
        episode_id: int | None = None,
        step_number: int | None = None,
    ) -> None:
        """Write down something worth knowing that is not a step, and who did it where somebody did."""
        said = {"kind": kind, "author": text(author), "text": text(words), "created_at": datetime.now(UTC)}
        where = {"campaign_id": campaign_id, "episode_id": episode_id, "step_number": step_number}
        with transaction(self.engine) as connection:
            connection.execute(insert(Event), said | where)

    def attended(self, episode_id: int, operator: str) -> None:
        """Write down who stands beside the robot of an episode that is about to run: its session, begun if need be."""
        with transaction(self.engine) as connection:
            attend(connection, self._process_id, episode_id, operator)

    def nobody_attends(self) -> None:
        """End this process's session; without one nothing happens."""
        with transaction(self.engine) as connection:
            end_sessions(connection, self._process_id)

    def lock_study(self, lock: StudyLock) -> RecordedStudy:
        """Write a study with its campaigns, trials and schedule: all of it or nothing.

        Raises:
            StudyError: its trials are another study's, or were begun before the plan was locked.
        """
        with transaction(self.engine) as connection:
            number = studies.lock_study(connection, lock, self._process_id)
            return read_study(connection, number)

    def amend_study(self, study_id: int, change: StudyChange) -> None:
        """Let another text be a study's plan; what changed, who changed it, when and why is kept."""
        with transaction(self.engine) as connection:
            studies.amend_study(connection, study_id, self._process_id, change)

    def unblind_study(self, study_id: int, reason: str) -> None:
        """Give a study's arms their names back, for everybody and for ever.

        Raises:
            StudyError: it is not blind.
        """
        with transaction(self.engine) as connection:
            studies.unblind_study(connection, study_id, self._process_id, reason=reason)

    def note_in_study(self, study_id: int, kind: str, words: str = "") -> None:
        """Append to what was done to a study."""
        with transaction(self.engine) as connection:
            studies.add_entry(connection, study_id, self._process_id, kind, words=words)

    def study_standing(self, study_id: int) -> tuple[StudyTrialStanding, ...]:
        """Say what has become of every scheduled trial of a study, in the order of its schedule."""
        with transaction(reading(self.engine)) as connection:
            return study_standing(connection, study_id, self._process_id)

    def who_else_runs(self, study_id: int) -> str:
        """Name another living process that runs a study, with its operator; empty for none."""
        with transaction(reading(self.engine)) as connection:
            return session_of_another(connection, study_id, self._process_id)

    def recover(self) -> tuple[RecoveredEpisode, ...]:
        """Close, as `interrupted`, the running episodes whose process is dead; their steps stay as they are.

        What such a process had claimed and not begun is released.
        """
        here = this_process()
        with transaction(reading(self.engine)) as connection:
            if not dead_episodes(connection, here) and not dead_sessions(connection, here):
                return ()
        with transaction(self.engine) as connection:
            # Looked at again under the lock: another process may have closed them first.
            found = [recover_one(connection, row) for row in dead_episodes(connection, here)]
            for session_id in dead_sessions(connection, here):
                end_session_of_the_dead(connection, session_id)
        return tuple(one for one in found if one is not None)

    def interrupted(self) -> tuple[RecoveredEpisode, ...]:
        """Return every episode that ended because its process did; what it left on the disk may be cleared away."""
        with transaction(reading(self.engine)) as connection:
            return interrupted(connection)
