"""The trial loop with a real database: claims, judgements, interventions and failures of single trials."""

import os
import signal
import socket
import sqlite3
import threading
import time
from contextlib import closing
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest

from tests.runner.stand_ins import PLAN, PROFILE, ScriptedPolicy, StandInRobot
from vsnbench.errors import RobotError
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.build import build
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.campaigns import CampaignPlan, OpenCampaign, Trial
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.executors.in_process import DrivingModel, InProcessExecutor
from vsnbench.runner.loop.campaign import CampaignSource
from vsnbench.runner.loop.contract import Session, SessionResult
from vsnbench.runner.loop.run import run
from vsnbench.runner.operator.contract import AbsentOperator, EndedEpisode, Judgement, Operator
from vsnbench.runner.operator.placing import Placing
from vsnbench.runner.stopping.emergency_key import PRESSED
from vsnbench.runner.stopping.requests import StopAuthor, Stopped, StopRequest, StopRequests
from vsnbench.sites.site import StartingPosition
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.model.card import ModelCard
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action
from vsnbench.values.robot_identity import RobotIdentity


@pytest.fixture
def results(tmp_path: Path) -> ResultsDirectory:
    place = ResultsDirectory.locate(tmp_path, None)
    place.prepare()
    return place


def campaign_of(journal: Journal, *, simulated: bool = False, starts: int = 1):
    plan = CampaignPlan(
        site=PLAN.site,
        robot=RobotIdentity(PROFILE, "simulated" if simulated else "ros1", simulated),
        model=ModelCard("scripted"),
        protocol=PLAN.parameters,
        seed=0,
        trials=[Trial(PLAN.goal, number) for number in range(1, starts + 1)],
    )
    return journal.find_or_create_campaign(plan)


class Person(AbsentOperator):
    """Places the robot immediately, and judges episodes with scripted answers."""

    def __init__(self, *judgements: Judgement | Stopped | None) -> None:
        super().__init__()
        self.judgements = list(judgements)
        self.placed: list[int] = []
        self.ended: list[EndedEpisode] = []

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        self.placed.append(start.number)

    def episode_ended(self, ended: EndedEpisode) -> None:
        self.ended.append(ended)

    def judge(self, ended: EndedEpisode) -> Judgement | None:
        judgement = self.judgements.pop(0)
        if isinstance(judgement, Stopped):
            raise judgement
        return judgement


@dataclass
class ByHand(StandInRobot):
    """A real robot that a person places; failures to begin are scripted."""

    simulated: bool = False
    needs_operator: bool = True
    broken_starts: frozenset[int] = frozenset()

    def begin(self, start: StartingPosition, seed: int) -> None:
        if start.number in self.broken_starts:
            raise RobotError(f"starting position {start.number} touches sofa-1")
        super().begin(start, seed)


def run_campaign(
    journal: Journal,
    campaign: OpenCampaign,
    robot: StandInRobot,
    operator: Operator,
    policy: ScriptedPolicy,
    recording: RecordingOptions,
    stop: StopRequests,
) -> SessionResult:
    model = DrivingModel(policy, "scripted")
    session = Session(
        journal=journal,
        robots=InProcessExecutor(robot, lambda _trial: model),
        recording=recording,
        site=PLAN.site,
        parameters=PLAN.parameters,
        stop_requests=stop,
        operator=operator,
    )
    source = CampaignSource(session, campaign)
    return source.result(run(source, session))


def drive(
    results: ResultsDirectory,
    robot: StandInRobot,
    person: AbsentOperator,
    script: list[Action | Exception],
    starts: int = 1,
    stop: StopRequests | None = None,
    *,
    own_thread: bool = True,
) -> SessionResult:
    with Journal.open(results.database_url) as journal, stop or StopRequests() as stopping:
        campaign = campaign_of(journal, simulated=robot.simulated, starts=starts)
        recording = RecordingOptions(results, operator_name="maria", own_thread=own_thread)
        return run_campaign(journal, campaign, robot, person, ScriptedPolicy(script), recording, stopping)


def read(results: ResultsDirectory, query: str) -> list[tuple[Any, ...]]:
    with closing(sqlite3.connect(results.path / "vsnbench.db")) as connection:
        return connection.execute(query).fetchall()


def states(results: ResultsDirectory) -> list[tuple[Any, ...]]:
    return read(results, "SELECT state, end_reason FROM episode ORDER BY id")


def counted(results: ResultsDirectory) -> int:
    activity = build(results.database_url, Selection()).activity
    assert activity is not None
    (robot,) = activity.robots
    return int(robot["interventions"])


TAPED = Judgement(Verdict(EndReason.STOP, False, "taped", GoalDistance(1.2, PoseSource.TAPE, "chair-1")))
CALLED = Judgement(
    Verdict(EndReason.COLLISION, False, "failed: collision: the table (seen by a person)"), "the table", True
)


def test_a_real_robots_episode_counts_after_a_judgement(results: ResultsDirectory) -> None:
    result = drive(results, ByHand(), Person(TAPED, None), [Action.STOP], starts=2)
    assert states(results) == [("judged", "stop"), ("awaiting", "stop")]
    assert (result.episodes, result.left, result.awaiting) == (2, 0, 1)
    assert read(
        results, "SELECT author, source, proposed, reason FROM verdict WHERE episode_id = 1 AND NOT proposed"
    ) == [("maria", "person", 0, "taped")]


def test_a_closed_terminal_leaves_the_episode_awaiting_judgement(results: ResultsDirectory) -> None:
    hung_up = Stopped(StopRequest(StopAuthor.SYSTEM, "a terminal that was closed"))
    with pytest.raises(Stopped):
        drive(results, ByHand(), Person(hung_up), [Action.TURN_LEFT, Action.STOP], starts=2)
    assert states(results) == [("awaiting", "stop")]
    assert read(results, "SELECT count(*) FROM step") == [(2,)]


def test_a_session_that_ends_at_a_placement_records_nothing(results: ResultsDirectory) -> None:
    class Leaving(Person):
        def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
            (state,) = states(results)
            assert state == ("claimed", None), "the claim keeps other processes away"
            raise Stopped(StopRequest(StopAuthor.PERSON, "Ctrl-C"))

    with pytest.raises(Stopped):
        drive(results, ByHand(), Leaving(), [Action.STOP])
    assert states(results) == []


def test_an_unattended_real_run_awaits_judgement(results: ResultsDirectory) -> None:
    assert drive(results, ByHand(), AbsentOperator(), [Action.STOP]).awaiting == 1
    assert states(results) == [("awaiting", "stop")]


def test_a_start_that_cannot_begin_is_void_and_the_session_continues(results: ResultsDirectory) -> None:
    robot, person = ByHand(broken_starts=frozenset({1})), Person(TAPED, TAPED)
    result = drive(results, robot, person, [Action.STOP], starts=3)
    assert states(results) == [("void", "motion_failed"), ("judged", "stop"), ("judged", "stop")]
    assert read(results, "SELECT error FROM episode WHERE id = 1") == [
        ("could not begin: starting position 1 touches sofa-1",)
    ]
    assert (result.void, result.left, result.stopped_because) == (1, 1, "")
    assert person.placed == [1, 2, 3]


def test_three_consecutive_void_episodes_end_the_session(results: ResultsDirectory) -> None:
    robot = ByHand(broken_starts=frozenset(range(1, 6)))
    result = drive(results, robot, Person(), [Action.STOP], starts=5)
    assert (result.episodes, result.left) == (3, 5)
    assert result.stopped_because == (
        "3 consecutive void episodes, the last: could not begin: starting position 3 touches sofa-1"
    )


def test_the_failure_of_an_action_is_recorded_and_shown(results: ResultsDirectory) -> None:
    stalled = MotionResult(completed=False, failure="discrete_move: stalled for 1 s")
    person = Person()
    result = drive(results, ByHand(on_execute=lambda _action: stalled), person, [Action.TURN_LEFT], starts=3)
    assert read(results, "SELECT DISTINCT error FROM episode") == [("discrete_move: stalled for 1 s",)]
    assert result.stopped_because.endswith("the last: discrete_move: stalled for 1 s")
    assert [ended.outcome.error for ended in person.ended] == ["discrete_move: stalled for 1 s"] * 3


def test_the_emergency_key_ends_the_episode_and_not_the_session(results: ResultsDirectory) -> None:
    robot, stop = ByHand(), StopRequests()

    def press(_action: Action) -> MotionResult:
        if len(robot.executed) in (2, 3, 4):  # once in each of three episodes
            stop.ask(PRESSED)
        return MotionResult(completed=True)

    robot.on_execute = press
    script: list[Action | Exception] = [Action.TURN_LEFT, Action.TURN_LEFT, Action.STOP]
    result = drive(results, robot, Person(TAPED), script, starts=4, stop=stop)
    assert states(results) == [*[("void", "aborted")] * 3, ("judged", "stop")]
    assert result.stopped_because == "", "a key press is not a fault"
    assert read(results, "SELECT text, author, step_number FROM event WHERE kind = 'intervention'") == [
        ("stopped with the emergency stop key", "maria", 1),
        ("stopped with the emergency stop key", "maria", None),
        ("stopped with the emergency stop key", "maria", None),
    ]
    assert counted(results) == 3, "the abort and its event are one intervention"


def test_ctrl_c_during_a_motion_is_one_intervention(results: ResultsDirectory) -> None:
    robot = ByHand()

    def interrupt(_action: Action) -> MotionResult:
        if len(robot.executed) == 2:
            os.kill(os.getpid(), signal.SIGINT)
        return MotionResult(completed=True)

    robot.on_execute = interrupt
    with pytest.raises(Stopped):
        drive(results, robot, (person := Person()), [Action.TURN_LEFT], starts=2)
    assert states(results) == [("void", "aborted")]
    assert [ended.outcome.error for ended in person.ended] == ["stopped with Ctrl-C"], "its end is shown as well"
    details = read(results, "SELECT text, author, step_number FROM event WHERE kind = 'intervention'")
    assert details == [("stopped with Ctrl-C", "maria", 1)]
    assert counted(results) == 1


def test_fetching_a_stranded_robot_is_one_intervention(
    results: ResultsDirectory,
) -> None:
    robot = ByHand()

    def fail_once(_action: Action) -> MotionResult:
        return MotionResult(completed=len(robot.executed) != 1, failure="" if len(robot.executed) != 1 else "stuck")

    robot.on_execute = fail_once
    drive(results, robot, Person(TAPED, CALLED), [Action.STOP], starts=3)
    query = "SELECT episode_id, step_number, author, text FROM event WHERE kind = 'intervention' ORDER BY id"
    assert read(results, query) == [
        (1, 1, "maria", "moved by hand after motion_failed"),
        (3, 1, "maria", "collision called: failed: collision: the table (seen by a person)"),
    ]


def test_without_a_spare_core_each_step_is_written_before_the_next(
    results: ResultsDirectory,
) -> None:
    kept: list[int] = []
    threads: set[str] = set()

    def look(_count: int) -> None:
        kept.append(int(read(results, "SELECT count(*) FROM step")[0][0]))
        threads.update(thread.name for thread in threading.enumerate())

    script: list[Action | Exception] = [Action.TURN_LEFT, Action.TURN_LEFT, Action.STOP]
    drive(results, StandInRobot(on_observe=look), Person(), script, own_thread=False)
    assert kept == [0, 1, 2]
    assert not [name for name in threads if name.startswith("recorder")]


def test_the_robot_waits_for_a_locked_database(results: ResultsDirectory) -> None:
    waited: list[int] = []
    robot = StandInRobot()
    locker = sqlite3.connect(results.path / "vsnbench.db", check_same_thread=False, isolation_level=None)

    with Journal.open(results.database_url) as journal, StopRequests() as stop:

        def goes_on() -> bool:
            waited.append(len(robot.executed))
            if len(waited) == 2:
                locker.execute("COMMIT")
            return False

        journal.patience.gives_up = goes_on
        robot.on_execute = lambda _action: (
            locker.execute("BEGIN IMMEDIATE") if len(robot.executed) == 1 else None,
            MotionResult(completed=True),
        )[1]
        policy = ScriptedPolicy([Action.TURN_LEFT, Action.TURN_LEFT, Action.STOP])
        campaign = campaign_of(journal, simulated=True)
        result = run_campaign(journal, campaign, robot, AbsentOperator(), policy, RecordingOptions(results), stop)
    locker.close()
    assert max(waited) <= 2, "one step was running, and no step begins before the last one is stored"
    assert (result.episodes, result.left) == (1, 0)
    assert read(results, "SELECT count(*) FROM step") == [(3,)]


@pytest.mark.parametrize(("simulated", "interventions"), [(False, 1), (True, 0)])
def test_an_abort_without_an_event_counts_for_a_real_robot(
    results: ResultsDirectory, simulated: bool, interventions: int
) -> None:
    with Journal.open(results.database_url) as journal:
        trial = campaign_of(journal, simulated=simulated).trials[0]
        handle = journal.claim_next(trial.campaign_id, [trial.id])
        assert handle is not None
        journal.place(handle.id, Fix(PLAN.start.pose, PoseSource.SURVEYED))
        journal.begin(handle.id, EpisodeBegin())
        void = Verdict(EndReason.ABORTED, None, "void")
        journal.end_episode(handle.id, EpisodeEnd(void, 3))
    assert counted(results) == interventions


def test_trials_of_a_process_that_died_run_before_the_session_ends(results: ResultsDirectory) -> None:
    class Dying(Person):
        """The other driver dies while this driver runs its first trial."""

        def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
            super().place(start, problem, placing)
            with closing(sqlite3.connect(results.path / "vsnbench.db")) as connection:
                connection.execute("UPDATE process SET start_ticks = 1 WHERE id = 1")
                connection.commit()

    with Journal.open(results.database_url) as other:
        campaign = campaign_of(other, starts=2)
        assert other.claim_next(campaign.id, [campaign.trials[0].id]) is not None
        person = Dying(None, None)
        result = drive(results, ByHand(), person, [Action.STOP], starts=2)
    assert person.placed == [2, 1]
    assert (result.episodes, result.left, result.elsewhere) == (2, 0, 0)


def test_trials_of_other_processes_are_counted_with_their_holders(results: ResultsDirectory) -> None:
    with Journal.open(results.database_url) as other:
        campaign = campaign_of(other, starts=2)
        assert other.claim_next(campaign.id, [campaign.trials[0].id]) is not None
        result = drive(results, ByHand(), Person(None), [Action.STOP], starts=2)
    assert (result.left, result.elsewhere, result.awaiting) == (0, 1, 1)
    assert result.holders == (f"process {os.getpid()} on {socket.gethostname()}",)


def test_an_aborted_trial_runs_again_first_with_a_page(results: ResultsDirectory) -> None:
    class AtThePage(Person):
        repeats_void_trials = True

    robot, person, stop = ByHand(), AtThePage(None, None), StopRequests()

    def press_once(_action: Action) -> MotionResult:
        if len(robot.executed) == 1:
            stop.ask(PRESSED)
        return MotionResult(completed=True)

    robot.on_execute = press_once
    drive(results, robot, person, [Action.TURN_LEFT, Action.STOP], starts=2, stop=stop)
    assert person.placed == [1, 1, 2]


def test_a_claim_is_renewed_during_a_long_placement(results: ResultsDirectory, monkeypatch: pytest.MonkeyPatch) -> None:
    class Slow(Person):
        def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
            first = read(results, "SELECT lease_until FROM episode")
            give_up_s = time.monotonic() + 20
            while read(results, "SELECT lease_until FROM episode") == first and time.monotonic() < give_up_s:
                threading.Event().wait(0.02)
            assert read(results, "SELECT lease_until FROM episode") > first

    monkeypatch.setattr("vsnbench.runner.executors.leases.LEASE", timedelta(seconds=0.15))
    drive(results, ByHand(), Slow(None), [Action.STOP])
