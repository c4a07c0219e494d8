"""A pool whose workers cannot reach the results database: the driver claims trials and stores the bundles they return.

Each trial is recorded once: a claim belongs to this driver alone, and the first bundle that returns for it closes it.
"""

import logging
import shutil
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from vsnbench.errors import EpisodeClosedError, RecordError, VsnbenchError
from vsnbench.files.atomic import part_path
from vsnbench.results.files.confined_paths import confined
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.episodes import Claim
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.executors.episode_bundle import EpisodeBundle
from vsnbench.runner.executors.leases import leases_renewed
from vsnbench.runner.executors.pool import TrialPool
from vsnbench.runner.loop.contract import ActionsTaken, EpisodeEnded, LoopEvent, Session, TrialReturned
from vsnbench.runner.setup.trial_setup import SetupDescription
from vsnbench.runner.stopping.requests import StopRequest

logger = logging.getLogger(__name__)


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
    def results(self, timeout_s: float) -> Sequence[EpisodeBundle | TrialReturned]:
        """Return finished tasks as soon as there is one, or nothing after the timeout.

        A task that ended without an episode is its trial and the cause.

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
        self._renewing = ExitStack()

    def session_begins(self, session: Session) -> None:
        """Run the trials of this session from now on, and keep their claims."""
        super().session_begins(session)
        self._renewing.enter_context(leases_renewed(session.journal, self._claims.values()))

    @property
    def free(self) -> int:
        """Number of trials that can begin now."""
        return max(0, self._runner.capacity - len(self._claims))

    @property
    def busy(self) -> int:
        """Number of trials that are running."""
        return len(self._claims)

    def begin(self, trial: Trial) -> bool:
        """Claim a trial and have it run, unless another process has claimed it."""
        claim = self.session.journal.claim_next(trial.campaign_id, [trial.id])
        if claim is not None:
            self._claims[trial.id] = claim
            self._runner.submit(trial, claim.seed)
        return True

    def reports(self, timeout_s: float) -> Sequence[LoopEvent]:
        """Store what has returned, and report it."""
        happened: list[LoopEvent] = []
        for result in self._runner.results(timeout_s):
            claim = self._claims.pop(result.trial.id, None) if result.trial is not None else None
            if claim is None:
                continue  # its claim was released
            journal = self.session.journal
            if isinstance(result, TrialReturned):
                journal.release(claim.id)
                happened.append(result)
                continue
            if difference := self.description.difference(result.description):
                journal.release(claim.id)
                raise VsnbenchError(
                    f"the worker on {result.host} differs from the campaign: {difference}",
                    advice="install the same vsnbench and the same model on every node",
                    code="worker-differs",
                )
            try:
                store_bundle(journal, self.session.recording.results, claim, result)
            except EpisodeClosedError as closed:
                logger.warning("%s", closed)
                continue
            happened += ActionsTaken(result.outcome.actions), EpisodeEnded(claim, result.outcome)
        return happened

    def stop(self, request: StopRequest) -> None:
        """Cancel all tasks. Episodes that have not returned are not recorded, and their trials are left."""
        del request
        self.halt()

    def halt(self) -> None:
        """Cancel all tasks and release their claims."""
        self._renewing.close()
        self._runner.cancel()
        while self._claims:
            _, claim = self._claims.popitem()
            try:
                self.session.journal.release(claim.id)
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
