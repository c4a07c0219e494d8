"""A trial that was sealed elsewhere and merged here is the trial as it would have been run here, exactly once."""

import sqlite3
from collections import deque
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from tests.runner.pool.test_handing_out import Lines
from tests.runner.stand_ins import APARTMENT
from vsnbench.database.campaign_plan import CampaignPlan, PlannedTrial, Trial
from vsnbench.database.journal import Journal
from vsnbench.errors import EpisodeClosedError, RecordError, VsnbenchError
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.record.results import ResultsDirectory
from vsnbench.runner.bench import Bench, BenchDescription, BenchPlan, open_bench
from vsnbench.runner.leftovers import sweep_results
from vsnbench.runner.pool.contract import WorkerLost
from vsnbench.runner.pool.handing_out import hand_out
from vsnbench.runner.pool.merging import MergingPool, TaskLost, keep_sealed
from vsnbench.runner.pool.messages import Keeping
from vsnbench.runner.pool.sealed import SealedEpisode, run_sealed
from vsnbench.runner.stopping import Stopping

PARAMETERS = ProtocolParameters(max_actions=3)
PLAN = BenchPlan(APARTMENT, "random", ("chair",), parameters=PARAMETERS)


@pytest.fixture(scope="module")
def bench() -> Any:
    with open_bench(PLAN) as made:
        yield made


class HereAsTasks:
    """Runs tasks in this process, and loses those that a test wants lost."""

    words = "1 worker here"
    room = 2

    def __init__(self, bench: Bench, lost: Sequence[int] = ()) -> None:
        self._bench = bench
        self._lost = list(lost)
        self._waiting: deque[tuple[Trial, int]] = deque()

    @property
    def description(self) -> BenchDescription:
        return self._bench.description

    def submit(self, trial: Trial, seed: int) -> None:
        self._waiting.append((trial, seed))

    def results(self, timeout_s: float) -> Sequence[SealedEpisode | TaskLost]:
        trial, seed = self._waiting.popleft()
        if trial.start in self._lost:
            self._lost.remove(trial.start)
            return [TaskLost(trial, "its node is gone")]
        return [run_sealed(self._bench, self._bench.provenance("typed"), PLAN, trial, seed)]

    def cancel(self) -> None:
        self._waiting.clear()


def opened(bench: Bench, path: Path, starts: int) -> tuple[ResultsDirectory, Journal, Keeping]:
    results = ResultsDirectory.locate(path)
    results.prepare()
    described = bench.description
    trials = [PlannedTrial("chair", number) for number in range(1, starts + 1)]
    plan = CampaignPlan(APARTMENT, described.robot, described.model, PARAMETERS, 0, trials, described.conditions)
    journal = Journal.open(results.database_url)
    return results, journal, Keeping(journal.find_or_create_campaign(plan), results, None, "maria")


def rows(results: ResultsDirectory, query: str) -> list[tuple[Any, ...]]:
    with closing(sqlite3.connect(results.path / "vsnbench.db")) as connection:
        return connection.execute(query).fetchall()


def test_every_trial_is_merged_once_and_a_lost_one_is_run_again(bench: Bench, tmp_path: Path) -> None:
    results, journal, keeping = opened(bench, tmp_path, starts=3)
    lines = Lines()
    with journal, Stopping() as stop, MergingPool(HereAsTasks(bench, lost=[2])) as pool:
        result = hand_out(journal, keeping, APARTMENT, PARAMETERS, pool, lines, stop)
    assert (result.episodes, result.left) == (3, 0)
    assert "a worker ended with its node is gone at chair from 2, which is taken again" in lines.said
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


def test_a_claim_that_was_closed_elsewhere_takes_nothing_in(bench: Bench, tmp_path: Path) -> None:
    results, journal, keeping = opened(bench, tmp_path, starts=1)
    with journal:
        (trial,) = keeping.campaign.trials
        claim = journal.claim_next(keeping.campaign.id, [trial.id])
        assert claim is not None
        sealed = run_sealed(bench, bench.provenance("typed"), PLAN, trial, claim.seed)
        keep_sealed(journal, results, claim, sealed)
        with pytest.raises(EpisodeClosedError):
            keep_sealed(journal, results, claim, sealed)
    assert rows(results, "SELECT COUNT(*) FROM verdict") == [(1,)]
    assert rows(results, "SELECT COUNT(*) FROM step") == [(sealed.outcome.actions,)]


def test_a_driver_killed_between_files_and_rows_leaves_neither(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    results, journal, keeping = opened(bench, tmp_path, starts=1)
    with journal:
        (trial,) = keeping.campaign.trials
        claim = journal.claim_next(keeping.campaign.id, [trial.id])
        assert claim is not None
        sealed = run_sealed(bench, bench.provenance("typed"), PLAN, trial, claim.seed)

        def killed(*_: object) -> None:
            raise RecordError("here it is killed")

        with monkeypatch.context() as patched:
            patched.setattr(journal, "keep_sealed", killed)
            with pytest.raises(RecordError, match="killed"):
                keep_sealed(journal, results, claim, sealed)
    with closing(sqlite3.connect(tmp_path / "vsnbench.db")) as connection:  # its process is dead by now
        connection.execute("UPDATE process SET start_ticks = start_ticks - 1")
        connection.commit()
    with Journal.open(results.database_url) as again:
        sweep_results(results, again)
        assert [episode.steps for episode in again.recovered] == [0]
    assert [path for path in (tmp_path / "episodes").rglob("*") if path.is_file()] == []


def test_a_worker_with_another_bench_is_refused_by_name(bench: Bench, tmp_path: Path) -> None:
    _, journal, keeping = opened(bench, tmp_path, starts=1)
    with open_bench(BenchPlan(APARTMENT, "forward", ("chair",), parameters=PARAMETERS)) as other, journal:
        tasks = HereAsTasks(other)
        with MergingPool(tasks) as pool:
            pool._runner = _Saying(tasks, bench.description)  # the driver was told of another at first
            pool.begin(journal, keeping.campaign.trials[0], keeping)
            with pytest.raises(VsnbenchError, match=r"the worker on .* differs from the campaign: model .*; install"):
                pool.events(0.0)
        assert journal.standing(keeping.campaign).left == keeping.campaign.trials


class _Saying:
    """The same tasks, described as another bench."""

    def __init__(self, tasks: HereAsTasks, description: BenchDescription) -> None:
        self.description = description
        self.words, self.room = tasks.words, tasks.room
        self.submit, self.results, self.cancel = tasks.submit, tasks.results, tasks.cancel


def test_stopping_gives_every_claim_back(bench: Bench, tmp_path: Path) -> None:
    _, journal, keeping = opened(bench, tmp_path, starts=2)
    with journal:
        with MergingPool(HereAsTasks(bench, lost=[1])) as pool:
            for trial in keeping.campaign.trials:
                pool.begin(journal, trial, keeping)
            assert pool.busy == 2
            assert isinstance(pool.events(0.0)[0], WorkerLost)
        assert journal.standing(keeping.campaign).left == keeping.campaign.trials
