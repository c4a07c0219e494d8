"""A pool whose workers cannot reach the results database: the driver claims trials and stores the bundles they return.

Each trial is recorded once: a claim belongs to this driver alone, and the first bundle that returns for it closes it.
"""

import logging
import shutil
import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from vsnbench.errors import EpisodeClosedError, RecordError, VsnbenchError
from vsnbench.files.atomic import part_path
from vsnbench.results.files.confined_paths import confined
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.episodes import Claim
from vsnbench.results.writing.journal import Journal
from vsnbench.results.writing.lifecycle import LEASE
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.executors.contract import ActionsTaken, EpisodeStored, PoolEvent, TrialPool, WorkerLost
from vsnbench.runner.executors.episode_bundle import EpisodeBundle
from vsnbench.runner.setup.trial_setup import SetupDescription
from vsnbench.runner.stopping.requests import StopRequest

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class TaskLost:
    """A task that ended without an episode."""

    trial: Trial
    cause: str


class TaskRunner(ABC):
    """Runs trials as tasks on other machines."""

    description: SetupDescription
    """Description that the setups of all workers share."""
    summary: str
    """Number of workers, and where they are."""

    @property
    @abstractmethod
    def capacity(self) -> int:
        """Number of tasks to submit at once: those that run, and those that wait for a worker."""

    @abstractmethod
    def submit(self, trial: Trial, seed: int) -> None:
        """Have a trial run."""

    @abstractmethod
    def results(self, timeout_s: float) -> Sequence[EpisodeBundle | TaskLost]:
        """Return finished tasks as soon as there is one, or nothing after the timeout.

        Raises:
            VsnbenchError: a failure that every worker would repeat.
        """

    @abstractmethod
    def cancel(self) -> None:
        """Cancel all tasks."""


class MergingPool(TrialPool):
    """Claims trials, has them run as tasks and stores what they return."""

    def __init__(self, runner: TaskRunner) -> None:
        self.description, self.summary = runner.description, runner.summary
        self._runner = runner
        self._claims: dict[int, Claim] = {}
        """Claims of the running tasks, by trial ID."""
        self._recording: RecordingOptions | None = None
        self._journal: Journal | None = None
        self._over = threading.Event()

    @property
    def free(self) -> int:
        """Number of trials that can begin now."""
        return max(0, self._runner.capacity - len(self._claims))

    @property
    def busy(self) -> int:
        """Number of trials that are running."""
        return len(self._claims)

    def begin(self, journal: Journal, trial: Trial, recording: RecordingOptions) -> None:
        """Claim a trial and have it run, unless another process has claimed it."""
        if self._journal is None:
            self._journal, self._recording = journal, recording
            threading.Thread(target=self._renew, args=(journal,), name="claims", daemon=True).start()
        claim = journal.claim_next(trial.campaign_id, [trial.id])
        if claim is not None:
            self._claims[trial.id] = claim
            self._runner.submit(trial, claim.seed)

    def events(self, timeout_s: float) -> Sequence[PoolEvent]:
        """Store what has returned, and report it."""
        happened: list[PoolEvent] = []
        for result in self._runner.results(timeout_s):
            claim = self._claims.pop(result.trial.id, None)
            if claim is None or self._journal is None or self._recording is None:
                continue  # its claim was released
            if isinstance(result, TaskLost):
                self._journal.release(claim.id)
                happened.append(WorkerLost(result.trial, result.cause))
                continue
            if difference := self.description.difference(result.description):
                self._journal.release(claim.id)
                raise VsnbenchError(
                    f"the worker on {result.host} differs from the campaign: {difference}",
                    advice="install the same vsnbench and the same model on every node",
                    code="worker-differs",
                )
            try:
                store_bundle(self._journal, self._recording.results, claim, result)
            except EpisodeClosedError as closed:
                logger.warning("%s", closed)
                continue
            happened.append(ActionsTaken(result.outcome.actions))
            happened.append(EpisodeStored(claim.id, result.trial, result.outcome))
        return happened

    def stop(self, request: StopRequest) -> None:
        """Cancel all tasks. Episodes that have not returned are not recorded, and their trials are left."""
        del request
        self.kill()

    def kill(self) -> None:
        """Cancel all tasks and release their claims."""
        self._over.set()
        self._runner.cancel()
        while self._claims and self._journal is not None:
            _, claim = self._claims.popitem()
            try:
                self._journal.release(claim.id)
            except RecordError as error:
                logger.warning("episode %d: %s", claim.id, error)

    def _renew(self, journal: Journal) -> None:
        """Renew the leases of the claims while their tasks run."""
        while not self._over.wait(LEASE.total_seconds() / 3):
            for claim in list(self._claims.values()):
                try:
                    journal.renew(claim.id)
                except RecordError as error:
                    logger.warning("episode %d: %s", claim.id, error)


def store_bundle(journal: Journal, results: ResultsDirectory, claim: Claim, bundle: EpisodeBundle) -> None:
    """Store an episode: its files appear at once, its steps and its end in one transaction.

    If this process is killed between the two, the episode is `interrupted` without steps, and the next start removes
    its files.

    Raises:
        EpisodeClosedError: this process no longer holds the claim.
        RecordError: the results cannot be written.
    """
    rows = bundle.rows
    if rows.placed is not None:
        journal.place(claim.id, rows.placed)
    if rows.begun is not None:
        journal.begin(claim.id, rows.begun)
        if bundle.files:
            _put_files(results.episode_directory(claim.images_directory), bundle.files)
    journal.store_bundle(claim.id, rows)


def _put_files(directory: Path, files: Mapping[str, bytes]) -> None:
    part = part_path(directory)
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        for folder in {name.rpartition("/")[0] for name in files} - {""}:
            confined(part, folder).mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            if name.rpartition("/")[2] in ("", ".", ".."):
                raise RecordError(f"a worker returned a file with the invalid name {name!r}")
            with open(f"{part}/{name}", "wb") as file:  # noqa: PTH123 - hundreds an episode, thousands a second
                file.write(content)
        part.rename(directory)
    except OSError as error:
        raise RecordError(
            f"cannot write {directory}: {error.strerror or error}",
            advice="free some space or check the permissions",
        ) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
