"""A trial that ran elsewhere is stored once, as it would have been in a local run."""

import sqlite3
from collections import deque
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from tests.runner.executors.test_pool import Lines, Rig
from tests.runner.stand_ins import APARTMENT
from vsnbench.errors import EpisodeClosedError, RecordError, VsnbenchError
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.files.images import depth_path, rgb_path
from vsnbench.results.writing.campaigns import CampaignPlan, Trial
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.executors.collecting import MergingPool, TaskRunner, store_bundle
from vsnbench.runner.executors.episode_bundle import EpisodeBundle, run_bundled
from vsnbench.runner.loop.contract import TrialReturned
from vsnbench.runner.setup.cleanup import sweep_results
from vsnbench.runner.setup.trial_setup import TrialSetup, TrialSetupSpec, open_trial_setup
from vsnbench.values.encoding.image_digest import file_digest

PARAMETERS = ProtocolParameters(max_actions=3)
PLAN = TrialSetupSpec(APARTMENT, "random", ("chair",), parameters=PARAMETERS)


@pytest.fixture(scope="module")
def setup() -> Any:
    with open_trial_setup(PLAN) as made:
        yield made


class LocalTasks(TaskRunner):
    """Runs tasks in this process, and loses those of chosen starts."""

    summary = "1 worker here"
    capacity = 2

    def __init__(self, setup: TrialSetup, lost: Sequence[int] = ()) -> None:
        self._setup = setup
        self.description = setup.description
        self._lost = list(lost)
        self._waiting: deque[tuple[Trial, int]] = deque()

    def submit(self, trial: Trial, seed: int) -> None:
        self._waiting.append((trial, seed))

    def results(self, timeout_s: float) -> Sequence[EpisodeBundle | TrialReturned]:
        trial, seed = self._waiting.popleft()
        if trial.start in self._lost:
            self._lost.remove(trial.start)
            return [TrialReturned(trial, "its node is gone")]
        return [run_bundled(self._setup, self._setup.provenance("typed"), PLAN, trial, seed)]

    def cancel(self) -> None:
        self._waiting.clear()


def campaign_of(setup: TrialSetup, path: Path, starts: int) -> Rig:
    results = ResultsDirectory.locate(path)
    results.prepare()
    described = setup.description
    trials = [Trial("chair", number) for number in range(1, starts + 1)]
    plan = CampaignPlan(APARTMENT, described.robot, described.model, PARAMETERS, 0, trials, described.conditions)
    journal = Journal.open(results.database_url)
    return Rig(journal, journal.find_or_create_campaign(plan), results, APARTMENT, PARAMETERS)


def rows(results: ResultsDirectory, query: str) -> list[tuple[Any, ...]]:
    with closing(sqlite3.connect(results.path / "vsnbench.db")) as connection:
        return connection.execute(query).fetchall()


def test_every_trial_is_stored_once_and_a_lost_one_runs_again(setup: TrialSetup, tmp_path: Path) -> None:
    rig, lines = campaign_of(setup, tmp_path, starts=3), Lines()
    with rig.journal, MergingPool(LocalTasks(setup, lost=[2])) as pool:
        result = rig.run(pool, lines)
    results = rig.results
    assert (result.episodes, result.left) == (3, 0)
    assert "a worker ended with its node is gone at chair from 2; the trial will run again" in lines.lines
    assert rows(results, "SELECT COUNT(*), COUNT(DISTINCT trial_id), MIN(state) FROM episode") == [(3, 3, "judged")]
    assert rows(results, "SELECT DISTINCT p.command FROM episode e JOIN process p ON p.id = e.process_id") == [
        ("typed",)
    ]
    for number, directory, actions in rows(results, "SELECT id, images_directory, actions FROM episode"):
        written = rows(results, f"SELECT number FROM step WHERE episode_id = {number} ORDER BY number")
        assert [step for (step,) in written] == list(range(1, actions + 1))
        assert len(list((tmp_path / directory / "rgb").glob("*.jpg"))) == actions
        assert len(list((tmp_path / directory / "depth").glob("*.png"))) == actions
        assert (tmp_path / directory / "trajectory.tum").is_file()
    for directory, number, rgb, depth in rows(
        results,
        "SELECT images_directory, number, rgb_file_digest, depth_file_digest FROM step JOIN episode ON id = episode_id",
    ):
        assert rgb == file_digest(rgb_path(tmp_path / directory, number).read_bytes())
        assert depth == file_digest(depth_path(tmp_path / directory, number).read_bytes())


def test_a_closed_claim_stores_nothing(setup: TrialSetup, tmp_path: Path) -> None:
    rig = campaign_of(setup, tmp_path, starts=1)
    results, journal, campaign = rig.results, rig.journal, rig.campaign
    with journal:
        (trial,) = campaign.trials
        claim = journal.claim_next(campaign.id, [trial.id])
        assert claim is not None
        bundle = run_bundled(setup, setup.provenance("typed"), PLAN, trial, claim.seed)
        store_bundle(journal, results, claim, bundle)
        with pytest.raises(EpisodeClosedError):
            store_bundle(journal, results, claim, bundle)
    assert rows(results, "SELECT COUNT(*) FROM verdict") == [(1,)]
    assert rows(results, "SELECT COUNT(*) FROM step") == [(bundle.outcome.actions,)]


def test_a_driver_killed_between_files_and_rows_leaves_neither(
    setup: TrialSetup, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = campaign_of(setup, tmp_path, starts=1)
    results, journal, campaign = rig.results, rig.journal, rig.campaign
    with journal:
        (trial,) = campaign.trials
        claim = journal.claim_next(campaign.id, [trial.id])
        assert claim is not None
        bundle = run_bundled(setup, setup.provenance("typed"), PLAN, trial, claim.seed)

        def killed(*_: object) -> None:
            raise RecordError("here it is killed")

        with monkeypatch.context() as patched:
            patched.setattr(journal, "store_bundle", killed)
            with pytest.raises(RecordError, match="killed"):
                store_bundle(journal, results, claim, bundle)
    with closing(sqlite3.connect(tmp_path / "vsnbench.db")) as connection:  # its process is dead by now
        connection.execute("UPDATE process SET start_ticks = start_ticks - 1")
        connection.commit()
    with Journal.open(results.database_url) as again:
        sweep_results(results, again)
        assert [episode.steps for episode in again.recovered] == [0]
    assert [path for path in (tmp_path / "episodes").rglob("*") if path.is_file()] == []


def test_a_worker_with_another_setup_is_refused(setup: TrialSetup, tmp_path: Path) -> None:
    rig = campaign_of(setup, tmp_path, starts=1)
    journal, campaign = rig.journal, rig.campaign
    with open_trial_setup(TrialSetupSpec(APARTMENT, "forward", ("chair",), parameters=PARAMETERS)) as other, journal:
        tasks = LocalTasks(other)
        tasks.description = setup.description
        with MergingPool(tasks) as pool:
            pool.session_begins(rig.session(pool))
            pool.begin(campaign.trials[0])
            with pytest.raises(VsnbenchError) as refused:
                pool.reports(0.0)
        assert refused.value.code == "worker-differs"
        assert journal.campaign_progress(campaign).left == campaign.trials


def test_stopping_releases_every_claim(setup: TrialSetup, tmp_path: Path) -> None:
    rig = campaign_of(setup, tmp_path, starts=2)
    journal, campaign = rig.journal, rig.campaign
    with journal:
        with MergingPool(LocalTasks(setup, lost=[1])) as pool:
            pool.session_begins(rig.session(pool))
            for trial in campaign.trials:
                pool.begin(trial)
            assert pool.busy == 2
            assert isinstance(pool.reports(0.0)[0], TrialReturned)
        assert journal.campaign_progress(campaign).left == campaign.trials
