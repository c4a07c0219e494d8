"""Trials on a pool of workers: their order, void episodes, lost workers and requests to stop."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.runner.stand_ins import PLAN, PROFILE
from vsnbench.protocol.disturbances import parse_disturbances
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.campaigns import CampaignPlan, OpenCampaign, Trial
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.results.writing.episodes import Claim
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.executors.pool import TrialPool
from vsnbench.runner.loop.campaign import CampaignSource
from vsnbench.runner.loop.contract import EpisodeEnded, LoopEvent, Session, SessionResult, TrialReturned
from vsnbench.runner.loop.follow_up import LOST_WORKER_LIMIT
from vsnbench.runner.loop.run import run
from vsnbench.runner.operator.contract import AbsentOperator, Display, EndedEpisode
from vsnbench.runner.stopping.requests import Stopped, StopRequest, StopRequests, of_signal
from vsnbench.sites.site import Site
from vsnbench.values.model.card import ModelCard
from vsnbench.values.robot_identity import RobotIdentity

SEED = 700
DISTURBED = parse_disturbances(["blur=2"])
DONE = EpisodeEnd(Verdict(EndReason.STOP, False, "failed"), 3, None, 0.1)
VOID = EpisodeEnd(Verdict(EndReason.MODEL_ERROR, None, "void"), 0, None, 0.1, "act: no weights")


class ScriptedPool(TrialPool):
    """Two workers with scripted results, in the order in which the trials begin."""

    summary = "2 workers: scripted"

    def __init__(self, script: Sequence[EpisodeEnd | str]) -> None:
        self._script = deque(script)
        self._at: deque[Trial] = deque()
        self.begun: list[int] = []
        self.stopped: list[StopRequest] = []

    @property
    def free(self) -> int:
        return 2 - len(self._at)

    @property
    def busy(self) -> int:
        return len(self._at)

    def begin(self, trial: Trial) -> bool:
        self._at.append(trial)
        self.begun.append(trial.start)
        return True

    def reports(self, timeout_s: float) -> Sequence[LoopEvent]:
        trial, what = self._at.popleft(), self._script.popleft()
        claim = Claim(1, "", trial, SEED + trial.start, "")
        return [TrialReturned(trial, what) if isinstance(what, str) else EpisodeEnded(claim, what)]

    def stop(self, request: StopRequest) -> None:
        self.stopped.append(request)

    def halt(self) -> None: ...


class Lines(Display):
    """Collects the displayed messages."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.ended: list[EndedEpisode] = []

    def say(self, text: str) -> None:
        self.lines.append(text)

    def episode_ended(self, ended: EndedEpisode) -> None:
        self.ended.append(ended)


@dataclass
class Rig:
    """A campaign in a new database."""

    journal: Journal
    campaign: OpenCampaign
    results: ResultsDirectory
    site: Site = PLAN.site
    parameters: ProtocolParameters = PLAN.parameters

    def run(self, pool: TrialPool, lines: Lines, stop: StopRequests | None = None) -> SessionResult:
        session = self.session(pool)
        session.operator = AbsentOperator(lines)
        session.stop_requests = stop or StopRequests()
        with session.stop_requests:
            source = CampaignSource(session, self.campaign)
            return source.result(run(source, session))

    def session(self, pool: TrialPool) -> Session:
        return Session(
            journal=self.journal,
            robots=pool,
            recording=RecordingOptions(self.results),
            site=self.site,
            parameters=self.parameters,
            disturbances=DISTURBED,
        )


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    results = ResultsDirectory.locate(tmp_path, None)
    results.prepare()
    trials = [Trial(PLAN.goal, number) for number in range(1, 9)]
    robot = RobotIdentity(PROFILE, "simulated", simulated=True)
    plan = CampaignPlan(PLAN.site, robot, ModelCard("scripted"), PLAN.parameters, 0, trials)
    with Journal.open(results.database_url) as journal:
        yield Rig(journal, journal.find_or_create_campaign(plan), results)


def test_every_trial_runs_once_in_the_order_of_the_plan(rig: Rig) -> None:
    pool, lines = ScriptedPool([DONE] * 8), Lines()
    result = rig.run(pool, lines)
    assert pool.begun == [1, 2, 3, 4, 5, 6, 7, 8]
    assert (result.episodes, result.void, result.stopped_because) == (8, 0, "")
    assert [ended.plan.start.number for ended in lines.ended] == pool.begun
    plans = [(ended.plan.seed, ended.plan.disturbances) for ended in lines.ended]
    assert plans == [(SEED + start, DISTURBED) for start in pool.begun], "what is shown is the plan of the claim"
    assert lines.lines == ["2 workers: scripted"]


def test_a_trial_of_a_lost_worker_runs_again_after_the_others(rig: Rig) -> None:
    pool, lines = ScriptedPool([DONE, "SIGKILL", *[DONE] * 7]), Lines()
    assert rig.run(pool, lines).episodes == 8
    assert pool.begun == [1, 2, 3, 4, 5, 6, 7, 8, 2]
    assert lines.lines[1:] == ["a worker ended with SIGKILL at chair from 2; the trial will run again"]


def test_the_loop_waits_for_workers_that_replace_lost_ones(rig: Rig) -> None:
    class Starting(ScriptedPool):
        ready = True

        @property
        def free(self) -> int:
            return super().free if self.ready else 0

        def reports(self, timeout_s: float) -> Sequence[LoopEvent]:
            if not self.busy:
                self.ready = True
                return []
            happened = super().reports(timeout_s)
            self.ready = not isinstance(happened[0], TrialReturned)
            return happened

    pool = Starting([*["SIGKILL"] * 2, *[DONE] * 8])
    assert rig.run(pool, Lines()).episodes == 8
    assert pool.begun == [1, 2, 3, 4, 5, 6, 7, 8, 1, 2]


def test_three_consecutive_voids_begin_no_trial_and_let_running_ones_end(rig: Rig) -> None:
    pool = ScriptedPool([VOID, DONE, VOID, VOID, VOID, DONE])
    result = rig.run(pool, Lines())
    assert result.stopped_because == "3 consecutive void episodes, the last: act: no weights"
    assert pool.begun == [1, 2, 3, 4, 5, 6]
    assert (result.episodes, result.void) == (6, 4)


def test_ten_consecutive_lost_workers_end_the_session(rig: Rig) -> None:
    pool = ScriptedPool(["SIGSEGV"] * (LOST_WORKER_LIMIT + 1))
    result = rig.run(pool, Lines())
    assert result.stopped_because == (
        f"{LOST_WORKER_LIMIT} consecutive workers ended without a result, the last with SIGSEGV"
    )
    assert result.left == 8


def test_a_stop_request_reaches_the_workers(rig: Rig) -> None:
    pool, stop, request = ScriptedPool([DONE] * 8), StopRequests(), of_signal(15)
    stop.ask(request)
    with pytest.raises(Stopped):
        rig.run(pool, Lines(), stop)
    assert pool.stopped == [request]
