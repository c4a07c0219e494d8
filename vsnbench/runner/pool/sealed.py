"""One trial as one task: run anywhere from plain values, it comes back sealed: rows, files and hashes, whole.

A worker that seals needs no shared disk and no database. The same loop and the same recorder run the episode as where
the record is; only what they write goes into memory and a temporary directory, and from there into the seal.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from vsnbench.database.campaign_plan import Trial
from vsnbench.database.episode_entries import EpisodeBegin, EpisodeEnd
from vsnbench.database.episodes import Claim
from vsnbench.database.provenance import Provenance
from vsnbench.database.sealed import SealedEvent, SealedRows
from vsnbench.protocol.fix import Fix
from vsnbench.protocol.step_record import StepRecord
from vsnbench.record.results import ResultsDirectory
from vsnbench.runner.attendant import Unattended
from vsnbench.runner.bench import Bench, BenchDescription, BenchPlan
from vsnbench.runner.episode import EpisodeOutcome, EpisodePlan, run_episode
from vsnbench.runner.recorder import EpisodeRecorderFanOut, RecordingTarget
from vsnbench.runner.stopping import Stopping
from vsnbench.scratch import ScratchDirectory

_DIRECTORY = "episodes/000000"


@dataclass(frozen=True, slots=True)
class SealedEpisode:
    """An episode as it left the worker."""

    trial: Trial
    description: BenchDescription
    """The worker's bench: the driver keeps nothing that was run on another than its own campaign's."""
    outcome: EpisodeOutcome
    rows: SealedRows
    files: Mapping[str, bytes]
    """The episode's files by their path below its directory: images as they are in the record, and the trajectory."""

    @property
    def host(self) -> str:
        """Where it was run."""
        return self.rows.ran_on.identity.host


def run_sealed(bench: Bench, ran_on: Provenance, plan: BenchPlan, trial: Trial, seed: int) -> SealedEpisode:
    """Run a trial; a pure function of its bench's plan, the trial and the seed, but for what the clock says.

    Args:
        bench: made from `plan`.
        ran_on: this process.
        plan: site, robot, model and protocol.
        trial: what is to be run.
        seed: every random choice in it follows from it.
    """
    kept = _Kept()
    described = bench.description
    with ScratchDirectory("trial") as scratch:
        results = ResultsDirectory.locate(scratch.path)
        target = RecordingTarget(
            kept,
            results,
            described.title,
            described.robot.profile,
            None,
            ran_on.operator,
            plan.kept,
            beside=False,  # a cluster's worker has one core
        )
        recorder = EpisodeRecorderFanOut(target, Claim(0, "", trial, seed, _DIRECTORY))
        episode = EpisodePlan(plan.site, trial.goal, plan.site.start(trial.start), seed, plan.parameters)
        try:
            outcome = run_episode(bench.robot, bench.policy, episode, recorder, Unattended(), Stopping())
        finally:
            recorder.close()
        directory = results.path / _DIRECTORY
        files = {
            path.relative_to(directory).as_posix(): path.read_bytes()
            for path in sorted(directory.rglob("*"))
            if path.is_file()
        }
    return SealedEpisode(trial, described, outcome, kept.rows(ran_on), files)


class _Kept:
    """Takes what a recorder writes about one episode, as a journal would."""

    def __init__(self) -> None:
        self._placed: Fix | None = None
        self._begun: EpisodeBegin | None = None
        self._steps: list[StepRecord] = []
        self._events: list[SealedEvent] = []
        self._end: EpisodeEnd | None = None

    def place(self, episode_id: int, start: Fix) -> None:
        del episode_id
        self._placed = start

    def begin(self, episode_id: int, entry: EpisodeBegin) -> None:
        del episode_id
        self._begun = replace(entry, started_at=datetime.now(UTC))

    def append_step(self, episode_id: int, step: StepRecord) -> None:
        del episode_id
        self._steps.append(replace(step, recorded_at=datetime.now(UTC)))

    def add_event(
        self, kind: str, words: str, *, author: str = "", episode_id: int | None = None, step_number: int | None = None
    ) -> None:
        del episode_id
        self._events.append(SealedEvent(kind, words, author, step_number, datetime.now(UTC)))

    def end_episode(self, episode_id: int, end: EpisodeEnd) -> None:
        del episode_id
        self._end = replace(end, ended_at=datetime.now(UTC))

    def rows(self, ran_on: Provenance) -> SealedRows:
        if self._end is None:
            raise RuntimeError("an episode was sealed before it had ended")
        return SealedRows(ran_on, self._placed, self._begun, tuple(self._steps), tuple(self._events), self._end)
