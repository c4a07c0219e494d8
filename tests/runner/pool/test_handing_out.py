"""How trials are handed out: the order, voids in a row, workers that die, and a request to stop."""

from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from tests.runner.stand_ins import PLAN, PROFILE
from vsnbench.database.campaign_plan import CampaignPlan, ModelIdentity, PlannedTrial, Trial
from vsnbench.database.journal import Journal
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.robot_identity import RobotIdentity
from vsnbench.record.results import ResultsDirectory
from vsnbench.runner.attendant import EndedEpisode
from vsnbench.runner.bench import BenchDescription
from vsnbench.runner.episode import EpisodeOutcome
from vsnbench.runner.pool.contract import EpisodeKept, PoolEvent, WorkerLost
from vsnbench.runner.pool.handing_out import LOST_IN_A_ROW, hand_out
from vsnbench.runner.pool.messages import Keeping
from vsnbench.runner.session import SessionResult
from vsnbench.runner.stopping import Stopped, Stopping, StopRequest, of_signal

DONE = EpisodeOutcome(Verdict(EndReason.STOP, False, "failed"), 3, None, 0.1)
VOID = EpisodeOutcome(Verdict(EndReason.MODEL_ERROR, None, "void"), 0, None, 0.1, "act: no weights")


class ScriptedPool:
    """Two workers; what becomes of each trial is scripted, in the order in which they are begun."""

    words = "2 workers: scripted"

    def __init__(self, script: Sequence[EpisodeOutcome | str]) -> None:
        self._script = deque(script)
        self._at: deque[Trial] = deque()
        self.begun: list[int] = []
        self.stopped: list[StopRequest] = []

    @property
    def description(self) -> BenchDescription:
        raise AssertionError("trials were claimed already: what drives them is nothing that handing out asks")

    @property
    def free(self) -> int:
        return 2 - len(self._at)

    @property
    def busy(self) -> int:
        return len(self._at)

    def begin(self, journal: Journal, trial: Trial, keeping: Keeping) -> None:
        self._at.append(trial)
        self.begun.append(trial.start)

    def events(self, timeout_s: float) -> Sequence[PoolEvent]:
        trial, what = self._at.popleft(), self._script.popleft()
        return [WorkerLost(trial, what) if isinstance(what, str) else EpisodeKept(1, trial, what)]

    def stop(self, request: StopRequest) -> None:
        self.stopped.append(request)

    def kill(self) -> None: ...


class Lines:
    """Keeps what is shown."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.ended: list[EndedEpisode] = []

    def say(self, words: str) -> None:
        self.said.append(words)

    def pace(self, words: str) -> None: ...

    def episode_ended(self, ended: EndedEpisode) -> None:
        self.ended.append(ended)


@pytest.fixture
def keeping(tmp_path: Path) -> Iterator[tuple[Journal, Keeping]]:
    results = ResultsDirectory.locate(tmp_path, None)
    results.prepare()
    trials = [PlannedTrial(PLAN.goal, number) for number in range(1, 9)]
    robot = RobotIdentity(PROFILE, "simulated", simulated=True)
    plan = CampaignPlan(PLAN.site, robot, ModelIdentity("scripted"), PLAN.parameters, 0, trials)
    with Journal.open(results.database_url) as journal:
        yield journal, Keeping(journal.find_or_create_campaign(plan), results, None, "maria")


def handed_out(
    keeping: tuple[Journal, Keeping], pool: ScriptedPool, lines: Lines, stop: Stopping | None = None
) -> SessionResult:
    with stop or Stopping() as stopping:
        return hand_out(*keeping, PLAN.site, PLAN.parameters, pool, lines, stopping)


def test_every_trial_is_begun_once_in_the_order_of_the_plan(keeping: tuple[Journal, Keeping]) -> None:
    pool, lines = ScriptedPool([DONE] * 8), Lines()
    result = handed_out(keeping, pool, lines)
    assert pool.begun == [1, 2, 3, 4, 5, 6, 7, 8]
    assert (result.episodes, result.void, result.stopped_because) == (8, 0, "")
    assert [ended.plan.start.number for ended in lines.ended] == pool.begun
    assert lines.said == ["2 workers: scripted"]


def test_a_trial_whose_worker_died_is_taken_again_after_the_others(keeping: tuple[Journal, Keeping]) -> None:
    pool, lines = ScriptedPool([DONE, "SIGKILL", *[DONE] * 7]), Lines()
    assert handed_out(keeping, pool, lines).episodes == 8
    assert pool.begun == [1, 2, 3, 4, 5, 6, 7, 8, 2]
    assert lines.said[1:] == ["a worker ended with SIGKILL at chair from 2, which is taken again"]


def test_three_voids_in_a_row_begin_nothing_more_and_let_the_others_end(keeping: tuple[Journal, Keeping]) -> None:
    pool = ScriptedPool([VOID, DONE, VOID, VOID, VOID, DONE])
    result = handed_out(keeping, pool, Lines())
    assert result.stopped_because == "3 void episodes one after another, the last: act: no weights"
    assert pool.begun == [1, 2, 3, 4, 5, 6]
    assert (result.episodes, result.void) == (6, 4)


def test_workers_that_all_die_are_not_replaced_for_ever(keeping: tuple[Journal, Keeping]) -> None:
    pool = ScriptedPool(["SIGSEGV"] * (LOST_IN_A_ROW + 1))
    result = handed_out(keeping, pool, Lines())
    assert result.stopped_because == f"{LOST_IN_A_ROW} workers died one after another, the last with SIGSEGV"
    assert result.left == 8


def test_a_request_to_stop_is_handed_on_to_the_workers(keeping: tuple[Journal, Keeping]) -> None:
    pool, stop, request = ScriptedPool([DONE] * 8), Stopping(), of_signal(15)
    stop.ask(request)
    with pytest.raises(Stopped):
        handed_out(keeping, pool, Lines(), stop)
    assert pool.stopped == [request]
