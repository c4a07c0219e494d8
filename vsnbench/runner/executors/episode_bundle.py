"""Runs one trial as one task and packs its episode for transfer: database rows, files and hashes.

The worker needs neither a shared disk nor the database. The episode loop and the recorder are those of a local run;
their output goes into memory and a temporary directory.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from vsnbench.files.temporary import ScratchDirectory
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd
from vsnbench.results.writing.episodes import Claim
from vsnbench.results.writing.provenance import Provenance
from vsnbench.results.writing.remote_episodes import BundledEvent, BundledRows
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.recorder import EpisodeRecorderFanOut, RecordingOptions
from vsnbench.runner.episode.step import EpisodePlan
from vsnbench.runner.operator.contract import AbsentOperator
from vsnbench.runner.setup.trial_setup import SetupDescription, TrialSetup, TrialSetupSpec
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.values.fix import Fix
from vsnbench.values.step import StepRecord

_DIRECTORY = "episodes/000000"


@dataclass(frozen=True, slots=True)
class EpisodeBundle:
    """A finished episode, packed for transfer."""

    trial: Trial
    description: SetupDescription
    """Description of the worker's setup. The driver refuses bundles whose setup differs from the campaign's."""
    outcome: EpisodeEnd
    rows: BundledRows
    files: Mapping[str, bytes]
    """Images and the trajectory, by path relative to the episode's directory."""

    @property
    def host(self) -> str:
        """Host name of the worker."""
        return self.rows.ran_on.identity.host


def run_bundled(setup: TrialSetup, ran_on: Provenance, spec: TrialSetupSpec, trial: Trial, seed: int) -> EpisodeBundle:
    """Run a trial. Except for times, the result depends only on the spec, the trial and the seed."""
    rows = _BundledEpisode()
    description = setup.description
    with ScratchDirectory("trial") as scratch:
        results = ResultsDirectory.locate(scratch.path)
        # Without its own thread, because a cluster's worker has one core.
        options = RecordingOptions(results, operator_name=ran_on.operator, keep=spec.keep, own_thread=False)
        claim = Claim(0, "", trial, seed, _DIRECTORY)
        recorder = EpisodeRecorderFanOut(rows, options, description.robot.profile, description.title, claim)
        start = spec.site.start(trial.start)
        episode = EpisodePlan(spec.site, trial.goal, start, seed, spec.parameters, spec.disturbances)
        try:
            outcome = run_episode(setup.robot, setup.policy, episode, recorder, AbsentOperator(), StopRequests())
        finally:
            recorder.close()
        directory = results.path / _DIRECTORY
        files = {
            path.relative_to(directory).as_posix(): path.read_bytes()
            for path in sorted(directory.rglob("*"))
            if path.is_file()
        }
    return EpisodeBundle(trial, description, outcome, rows.rows(ran_on), files)


class _BundledEpisode:
    """Collects in memory what a recorder writes about one episode."""

    def __init__(self) -> None:
        self._placed: Fix | None = None
        self._begun: EpisodeBegin | None = None
        self._steps: list[StepRecord] = []
        self._events: list[BundledEvent] = []
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
        self._events.append(BundledEvent(kind, words, author, step_number, datetime.now(UTC)))

    def end_episode(self, episode_id: int, end: EpisodeEnd) -> None:
        del episode_id
        self._end = replace(end, ended_at=datetime.now(UTC))

    def rows(self, ran_on: Provenance) -> BundledRows:
        if self._end is None:
            raise RuntimeError("an episode was bundled before it ended")
        return BundledRows(ran_on, self._placed, self._begun, tuple(self._steps), tuple(self._events), self._end)
