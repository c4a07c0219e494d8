"""The only writer of the record: campaigns, episodes, steps, verdicts and events, each committed immediately."""

from collections.abc import Collection, Mapping, Sequence
from typing import Self

from sqlalchemy import Engine, insert

from vsnbench.errors import RecordError
from vsnbench.results.annotations import Annotation, annotate
from vsnbench.results.merging.episodes import OtherRecord
from vsnbench.results.merging.merge import apply_merge, lock_merges
from vsnbench.results.merging.plan import MergePlan, plan_merge
from vsnbench.results.schema.engine import LockWait, open_engine, reading, transaction
from vsnbench.results.schema.migrate import create_record, upgrade
from vsnbench.results.schema.row_encoding import event_row, insert_row, process_row, text
from vsnbench.results.schema.tables import EventRow, ProcessRow
from vsnbench.results.second_judgements import Outcome, add_second_judgement, retract_second_judgement
from vsnbench.results.studies import writing
from vsnbench.results.studies.entries import RecordedStudy, StudyChange, StudyLock, StudyTrialProgress
from vsnbench.results.studies.log import log_outcome
from vsnbench.results.studies.queries import read_study, session_of_another, study_progress
from vsnbench.results.writing import imports
from vsnbench.results.writing.campaigns import (
    CampaignPlan,
    CampaignProgress,
    OpenCampaign,
    campaign_progress,
    find_or_create,
)
from vsnbench.results.writing.entries import RecoveredEpisode
from vsnbench.results.writing.episodes import EpisodeWriter, PlaceFiles, attach_images
from vsnbench.results.writing.imports import ImportedEpisode
from vsnbench.results.writing.model_history import differences, last_of_its_name
from vsnbench.results.writing.provenance import Provenance, gather_provenance, this_process
from vsnbench.results.writing.recovery import interrupted, orphaned_episodes, orphaned_sessions, recover_one
from vsnbench.results.writing.remote_episodes import BundledRows, store_bundle
from vsnbench.results.writing.sessions import end_orphaned_session, end_sessions, join_session
from vsnbench.values.model.card import ModelCard


class Journal(EpisodeWriter):
    """An open record; a context manager that is safe for threads and processes.

    Every method commits before it returns, and raises RecordError if the database cannot be used.
    """

    def __init__(
        self,
        engine: Engine,
        process_id: int,
        recovered: tuple[RecoveredEpisode, ...] = (),
        patience: LockWait | None = None,
    ) -> None:
        self.engine = engine
        self.patience = patience or LockWait()
        """Maximum wait of every method while another process holds the lock of an SQLite file."""
        self._process_id = process_id
        self.recovered = recovered
        """Episodes of dead processes that were closed when the record was opened."""

    @classmethod
    def open(cls, url: str, provenance: Provenance | None = None) -> Self:
        """Open a database for writing: create or migrate it if needed, and recover episodes of dead processes.

        Raises:
            RecordError: the database cannot be used, or is from a newer vsnbench.
        """
        patience = LockWait()
        create_record(url)
        engine = open_engine(url, patience=patience)
        try:
            upgrade(engine)
            with transaction(engine) as connection:
                process_id = insert_row(connection, ProcessRow, process_row(provenance or gather_provenance()))
            journal = cls(engine, process_id, patience=patience)
            journal.recovered = journal.recover()
        except BaseException:
            engine.dispose()
            raise
        return journal

    def close(self) -> None:
        """Close the database connection."""
        self._steps.close_connection()
        self.engine.dispose()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def find_or_create_campaign(self, plan: CampaignPlan) -> OpenCampaign:
        """Return the campaign of a plan; new trials are added to it."""
        with transaction(self.engine) as connection:
            return find_or_create(connection, plan, self._process_id)

    def campaign_progress(self, campaign: OpenCampaign) -> CampaignProgress:
        """Return the states of the requested trials."""
        with transaction(reading(self.engine)) as connection:
            return campaign_progress(connection, campaign, self._process_id)

    def model_change(self, campaign: OpenCampaign, model: ModelCard) -> str:
        """Return the differences of a new campaign's model from the last one of that name, or an empty string."""
        if campaign.resumed:
            return ""
        with transaction(reading(self.engine)) as connection:
            last = last_of_its_name(connection, text(model.name), campaign.id)
        if last is None or not (found := differences(last[1], model)):
            return ""
        return f"model {model.name} differs from that of campaign {last[0]}: {', '.join(found)}"

    def store_bundle(self, episode_id: int, sealed: BundledRows) -> None:
        """Write the steps, events and end of an episode that a remote worker has run: all or nothing.

        The episode was placed and begun in this process if possible, and its files are on disk.

        Raises:
            EpisodeClosedError: the claim is lost; nothing was added.
        """
        with transaction(self.engine) as connection:
            store_bundle(connection, self._process_id, episode_id, sealed)

    def import_campaign(
        self, plan: CampaignPlan, episodes: Sequence[ImportedEpisode], place_files: PlaceFiles | None = None
    ) -> tuple[int, tuple[int, ...]]:
        """Write another tool's episodes, one per trial of the plan and in its order: all or nothing.

        Returns:
            The numbers of the campaign and the episodes.

        Raises:
            UsageError: a trial of the plan already has an episode that is not void.
        """
        with transaction(self.engine) as connection:
            return imports.import_episodes(connection, self._process_id, plan, episodes, place_files)

    def withdraw_import(self, campaign_id: int, *, author: str, note: str = "") -> int:
        """Void all episodes of an imported campaign and return their number; they can be imported again.

        Raises:
            UsageError: the campaign does not exist, or was not imported.
        """
        with transaction(self.engine) as connection:
            return imports.withdraw(connection, campaign_id, author=author, note=note)

    def merge(
        self, others: Sequence[OtherRecord], expected: Collection[str], with_files: Collection[str], place: PlaceFiles
    ) -> MergePlan:
        """Add the missing data of other records: all or nothing.

        Args:
            others: the other records, as `expected` was read from them.
            expected: UUIDs of the episodes to add.
            with_files: those of them whose files are added.
            place: called for each of these; it places the files before the commit.

        Raises:
            RecordError: the records contradict each other, or this one has changed since `expected` was read.
        """
        with transaction(self.engine) as connection:
            lock_merges(connection)
            plan = plan_merge(connection, others, thorough=False)
            if {arrival.uuid for arrival in plan.new_episodes} != set(expected):
                raise RecordError(
                    "another merge has changed the record", advice="nothing was written; repeat the command"
                )
            apply_merge(connection, others, plan, with_files, place)
            return plan

    def attach_images(self, numbers: Mapping[str, int], place: PlaceFiles) -> None:
        """Record that episodes without images have them now: all or none.

        `place` is called with each UUID and its directory, and moves the files there before the commit.
        """
        with transaction(self.engine) as connection:
            for uuid, number in numbers.items():
                place(uuid, attach_images(connection, number))

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
        """Record an event that is not a step, with its author if there is one."""
        where = {"campaign_id": campaign_id, "episode_id": episode_id, "step_number": step_number}
        with transaction(self.engine) as connection:
            connection.execute(insert(EventRow), event_row(kind, words, author=author, **where))

    def annotate(self, episode_ids: Collection[int], annotation: Annotation, *, author: str) -> None:
        """Append a note and changed tags to episodes: all or nothing. No verdict changes.

        Raises:
            UsageError: an episode does not exist.
        """
        with transaction(self.engine) as connection:
            annotate(connection, episode_ids, annotation, author)

    def judge_second(self, episode_id: int, rater: str, outcome: Outcome, words: str) -> None:
        """Record a rater's second judgement of an episode. No verdict changes.

        Raises:
            UsageError: the episode is unknown or has no first judgement, or the rater has judged or attended it.
        """
        with transaction(self.engine) as connection:
            add_second_judgement(connection, episode_id, rater, outcome, words)

    def retract_second(self, episode_id: int, rater: str) -> None:
        """Retract a rater's second judgement of an episode.

        Raises:
            UsageError: there is none.
        """
        with transaction(self.engine) as connection:
            retract_second_judgement(connection, episode_id, rater)

    def set_operator(self, episode_id: int, operator: str) -> None:
        """Set the operator of an episode that is about to run, and start a session if needed."""
        with transaction(self.engine) as connection:
            join_session(connection, self._process_id, episode_id, operator)

    def clear_operator(self) -> None:
        """End this process's session, if there is one."""
        with transaction(self.engine) as connection:
            end_sessions(connection, self._process_id)

    def lock_study(self, lock: StudyLock) -> RecordedStudy:
        """Write a study with its campaigns, trials and schedule: all or nothing.

        Raises:
            StudyError: its trials belong to another study, or have episodes.
        """
        with transaction(self.engine) as connection:
            number = writing.lock_study(connection, lock, self._process_id)
            return read_study(connection, number)

    def amend_study(self, study_id: int, change: StudyChange) -> None:
        """Replace the plan of a study, and record the changes, the author, the time and the reason."""
        with transaction(self.engine) as connection:
            writing.amend_study(connection, study_id, self._process_id, change)

    def unblind_study(self, study_id: int, reason: str) -> None:
        """Unblind a study for good.

        Raises:
            StudyError: the study is not blinded.
        """
        with transaction(self.engine) as connection:
            writing.unblind_study(connection, study_id, self._process_id, reason=reason)

    def note_in_study(self, study_id: int, kind: str, words: str = "") -> None:
        """Append an entry to the history of a study."""
        with transaction(self.engine) as connection:
            writing.add_entry(connection, study_id, self._process_id, kind, words=words)

    def study_progress(self, study_id: int) -> tuple[StudyTrialProgress, ...]:
        """Return the progress of all scheduled trials of a study, in the order of its schedule."""
        with transaction(reading(self.engine)) as connection:
            return study_progress(connection, study_id, self._process_id)

    def other_running_process(self, study_id: int) -> str:
        """Return a description of another live process that runs the study, or an empty string."""
        with transaction(reading(self.engine)) as connection:
            return session_of_another(connection, study_id, self._process_id)

    def recover(self) -> tuple[RecoveredEpisode, ...]:
        """Close the running episodes of dead processes as `interrupted`, with their steps.

        Claims of such processes are released.
        """
        here = this_process()
        with transaction(reading(self.engine)) as connection:
            if not orphaned_episodes(connection, here) and not orphaned_sessions(connection, here):
                return ()
        with transaction(self.engine) as connection:
            # Checked again under the lock, because another process may have closed them.
            found = [recover_one(connection, row) for row in orphaned_episodes(connection, here)]
            for session_id in orphaned_sessions(connection, here):
                end_orphaned_session(connection, session_id)
            for episode in filter(None, found):  # after all rows are written, because the log locks the study's row
                log_outcome(connection, episode.id)
        return tuple(episode for episode in found if episode is not None)

    def interrupted(self) -> tuple[RecoveredEpisode, ...]:
        """Return all episodes whose process died; their leftover files may be deleted."""
        with transaction(reading(self.engine)) as connection:
            return interrupted(connection)
