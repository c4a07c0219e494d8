"""A pool of workers that have no way to the record: the driver claims for them, and keeps what comes back sealed.

Exactly once a trial: a claim is this driver's alone, and is closed by the first sealed episode that comes back for it.
"""

import logging
import shutil
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from vsnbench.database.campaign_plan import Trial
from vsnbench.database.episodes import Claim
from vsnbench.database.journal import Journal
from vsnbench.database.lifecycle import LEASE
from vsnbench.errors import EpisodeClosedError, RecordError, VsnbenchError
from vsnbench.record.confined import confined
from vsnbench.record.results import ResultsDirectory
from vsnbench.runner.bench import BenchDescription
from vsnbench.runner.pool.contract import ActionsTaken, EpisodeKept, PoolEvent, WorkerLost
from vsnbench.runner.pool.messages import Keeping
from vsnbench.runner.pool.sealed import SealedEpisode
from vsnbench.runner.stopping import StopRequest
from vsnbench.whole_files import part_path

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class TaskLost:
    """A task that came back without an episode."""

    trial: Trial
    words: str


class TaskRunner(Protocol):
    """Runs trials as tasks somewhere else."""

    @property
    def description(self) -> BenchDescription:
        """What the benches there say of themselves."""
        ...

    @property
    def words(self) -> str:
        """Where it runs them, and how many at once."""
        ...

    @property
    def room(self) -> int:
        """How many tasks make sense at once: what is run, and what waits next to it."""
        ...

    def submit(self, trial: Trial, seed: int) -> None:
        """Have a trial run."""
        ...

    def results(self, timeout_s: float) -> Sequence[SealedEpisode | TaskLost]:
        """Return what has come back, as soon as something has, or nothing by then.

        Raises:
            VsnbenchError: no worker can do what was asked.
        """
        ...

    def cancel(self) -> None:
        """Have nothing run any more."""
        ...


class MergingPool:
    """Claims trials, has them run as tasks and merges what comes back; a context manager."""

    def __init__(self, runner: TaskRunner) -> None:
        self._runner = runner
        self._claims: dict[int, Claim] = {}
        """What is being run, by trial."""
        self._keeping: Keeping | None = None
        self._journal: Journal | None = None
        self._over = threading.Event()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()

    @property
    def description(self) -> BenchDescription:
        """What their benches say of themselves."""
        return self._runner.description

    @property
    def words(self) -> str:
        """How many workers there are, and why."""
        return self._runner.words

    @property
    def free(self) -> int:
        """How many trials can be begun now."""
        return max(0, self._runner.room - len(self._claims))

    @property
    def busy(self) -> int:
        """How many trials are being run."""
        return len(self._claims)

    def begin(self, journal: Journal, trial: Trial, keeping: Keeping) -> None:
        """Claim a trial and have it run, unless somebody else is at it."""
        if self._journal is None:
            self._journal, self._keeping = journal, keeping
            threading.Thread(target=self._renew, args=(journal,), name="claims", daemon=True).start()
        claim = journal.claim_next(keeping.campaign.id, [trial.id])
        if claim is not None:
            self._claims[trial.id] = claim
            self._runner.submit(trial, claim.seed)

    def events(self, timeout_s: float) -> Sequence[PoolEvent]:
        """Keep what has come back, and tell of it.

        Raises:
            VsnbenchError: no worker can do what was asked, or one has another bench than the campaign's.
        """
        happened: deque[PoolEvent] = deque()
        for back in self._runner.results(timeout_s):
            claim = self._claims.pop(back.trial.id, None)
            if claim is None or self._journal is None or self._keeping is None:
                continue  # nobody waits for it any more
            if isinstance(back, TaskLost):
                self._journal.release(claim.id)
                happened.append(WorkerLost(back.trial, back.words))
                continue
            if difference := self.description.difference(back.description):
                self._journal.release(claim.id)
                raise VsnbenchError(
                    f"the worker on {back.host} differs from the campaign: {difference}",
                    advice="install the same vsnbench and the same model on every node",
                )
            try:
                keep_sealed(self._journal, self._keeping.results, claim, back)
            except EpisodeClosedError as closed:
                logger.warning("%s", closed)
                continue
            happened.append(ActionsTaken(back.outcome.actions))
            happened.append(EpisodeKept(claim.id, back.trial, back.outcome))
        return happened

    def stop(self, request: StopRequest) -> None:
        """Have nothing run any more: an episode that has not come back is nobody's, and its trial is left."""
        del request
        self.kill()

    def kill(self) -> None:
        """End all at once, and give the claims back."""
        self._over.set()
        self._runner.cancel()
        while self._claims and self._journal is not None:
            _, claim = self._claims.popitem()
            try:
                self._journal.release(claim.id)
            except RecordError as error:
                logger.warning("episode %d: %s", claim.id, error)

    def _renew(self, journal: Journal) -> None:
        """Keep the claims alive, however long their tasks take."""
        while not self._over.wait(LEASE.total_seconds() / 3):
            for claim in list(self._claims.values()):
                try:
                    journal.renew(claim.id)
                except RecordError as error:
                    logger.warning("episode %d: %s", claim.id, error)


def keep_sealed(journal: Journal, results: ResultsDirectory, claim: Claim, sealed: SealedEpisode) -> None:
    """Merge an episode into the record: its files appear at once, its steps and its end in one transaction.

    Where this process is killed between the two, the episode is `interrupted` without a step, and the next start
    clears its files away.

    Raises:
        EpisodeClosedError: the claim is this process's no more.
        RecordError: the record cannot be written.
    """
    rows = sealed.rows
    if rows.placed is not None:
        journal.place(claim.id, rows.placed)
    if rows.begun is not None:
        journal.begin(claim.id, rows.begun)
        if sealed.files:
            _put_files(results.episode_directory(claim.images_directory), sealed.files)
    journal.keep_sealed(claim.id, rows)


def _put_files(directory: Path, files: Mapping[str, bytes]) -> None:
    part = part_path(directory)
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        for folder in {name.rpartition("/")[0] for name in files} - {""}:
            confined(part, folder).mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            if name.rpartition("/")[2] in ("", ".", ".."):
                raise RecordError(f"a worker sent a file named {name!r}, which cannot be kept")
            with open(f"{part}/{name}", "wb") as file:  # noqa: PTH123 - hundreds an episode, thousands a second
                file.write(content)
        part.rename(directory)
    except OSError as error:
        raise RecordError(
            f"cannot write {directory}: {error.strerror or error}",
            advice="free some space or look at the permissions",
        ) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
