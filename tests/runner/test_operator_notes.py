"""Interventions in a real record: who did what to a real robot, at which step, committed once and counted once."""

import os
import signal
from pathlib import Path

import pytest
from sqlalchemy import select

from tests.runner.stand_ins import PLAN, PROFILE, ScriptedPolicy, StandInRobot
from vsnbench.database.campaign_plan import CampaignPlan, ModelIdentity, PlannedTrial
from vsnbench.database.episode_entries import EpisodeBegin, EpisodeEnd
from vsnbench.database.journal import Journal
from vsnbench.database.queries import episode_details
from vsnbench.database.tables import Event
from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.motion_result import MotionResult
from vsnbench.protocol.robot_identity import RobotIdentity
from vsnbench.record.results import ResultsDirectory
from vsnbench.report.build import build
from vsnbench.report.record import Selection
from vsnbench.runner.episode import run_episode
from vsnbench.runner.operator_notes import OperatorNotes
from vsnbench.runner.recorder import EpisodeRecorderFanOut, RecordingTarget
from vsnbench.runner.stopping import Stopped, StopSignals


@pytest.fixture
def results(tmp_path: Path) -> ResultsDirectory:
    place = ResultsDirectory.locate(tmp_path, None)
    place.prepare()
    return place


def campaign_of(journal: Journal, *, simulated: bool = False):
    plan = CampaignPlan(
        site=PLAN.site,
        robot=RobotIdentity(PROFILE, "simulated" if simulated else "ros1", simulated),
        model=ModelIdentity("scripted"),
        protocol=PLAN.parameters,
        seed=0,
        trials=[PlannedTrial(PLAN.goal, PLAN.start.number)],
    )
    return journal.find_or_create_campaign(plan)


def stop_in_the_second_motion(journal: Journal, results: ResultsDirectory, *, by_key: bool) -> int:
    """Run an episode that a person stops, and return its number."""
    campaign = campaign_of(journal)
    claim = journal.claim_next(campaign.id, [campaign.trials[0].id])
    assert claim is not None
    recorder = EpisodeRecorderFanOut(RecordingTarget(journal, results, "scripted", PROFILE, operator="maria"), claim)
    robot = StandInRobot(simulated=False)
    stop = StopSignals()

    def drive(_action: Action) -> MotionResult:
        if len(robot.executed) == 2:
            if by_key:
                stop.key_pressed()
            os.kill(os.getpid(), signal.SIGINT)
        return MotionResult(completed=True)

    robot.on_execute = drive
    with stop, pytest.raises(Stopped):
        run_episode(robot, ScriptedPolicy([Action.TURN_LEFT]), PLAN, recorder, stop)
    recorder.close()
    return recorder.episode_id


def counted(results: ResultsDirectory) -> int:
    activity = build(results.database_url, Selection()).activity
    assert activity is not None
    (robot,) = activity.robots
    return robot.interventions


@pytest.mark.parametrize("by_key", [False, True])
def test_an_emergency_stop_is_one_event_with_its_step_and_its_author(results: ResultsDirectory, by_key: bool) -> None:
    with Journal.open(results.database_url) as journal:
        number = stop_in_the_second_motion(journal, results, by_key=by_key)
    with Journal.open(results.database_url) as reader:  # another connection: what it finds was committed
        details = episode_details(reader.engine, number)
    assert details.summary.end_reason == EndReason.ABORTED
    (event,) = [event for event in details.events if event.kind == "intervention"]
    how = "the emergency stop key" if by_key else "Ctrl-C"
    assert event.text == f"stopped with {how}, by maria"
    assert event.step_number == 1, "the last action that was kept"
    assert counted(results) == 1, "the abort and its event are one intervention"


def test_what_an_operator_did_is_kept_with_the_episode_and_counted(results: ResultsDirectory) -> None:
    with Journal.open(results.database_url) as journal:
        number = stop_in_the_second_motion(journal, results, by_key=True)
        OperatorNotes(journal, "jo").intervention(number, 0, "moved by hand after motion_failed")
        with journal.engine.connect() as connection:
            rows = connection.execute(select(Event.text, Event.step_number).where(Event.kind == "intervention")).all()
    assert [tuple(row) for row in rows][1:] == [("moved by hand after motion_failed, by jo", None)]
    assert counted(results) == 2


@pytest.mark.parametrize(("simulated", "interventions"), [(False, 1), (True, 0)])
def test_an_abort_without_an_event_counts_where_the_robot_is_real(
    results: ResultsDirectory, simulated: bool, interventions: int
) -> None:
    with Journal.open(results.database_url) as journal:
        trial = campaign_of(journal, simulated=simulated).trials[0]
        handle = journal.claim_next(trial.campaign_id, [trial.id])
        assert handle is not None
        journal.place(handle.id, Fix(PLAN.start.pose, PoseSource.SURVEYED))
        journal.begin(handle.id, EpisodeBegin())
        void = Verdict(EndReason.ABORTED, None, "void")
        journal.end_episode(handle.id, EpisodeEnd(EndReason.ABORTED, 3, void))
    assert counted(results) == interventions
