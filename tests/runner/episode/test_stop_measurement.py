"""Where a robot stopped: measured from its last looks, judged by it, and by the odometry where that is not possible."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.support.placement_trials import NoisyEye
from benchmarks.support.stops import DrivenWay, drive, way_to_wall
from tests.runner.episode.test_episode import MemoryRecorder
from tests.runner.stand_ins import APARTMENT, NOBODY, PROFILE, ScriptedPolicy, StandInRobot
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.stop_pose import StopPose, range_text
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.rehearsal import RehearsalRobot
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.step import EpisodePlan
from vsnbench.runner.episode.stop_measurement import StopMeasurement
from vsnbench.runner.operator.contract import AbsentOperator
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.simulator.dynamics.noise import NoiseSettings, OdometryNoise
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.movement import Action
from vsnbench.values.observation import observation_of
from vsnbench.values.placement import MeasuredPlacement, PlacementMethod, PlacementTolerance, PoseCovariance
from vsnbench.values.pose import Pose

PARAMETERS = ProtocolParameters()
TURTLEBOT = load_profile("turtlebot2")
SMALL = TURTLEBOT.model_copy(update={"camera": TURTLEBOT.camera.resized(160, 120)})
DRIVES = [Action.TURN_LEFT, Action.MOVE_FORWARD, Action.MOVE_FORWARD, Action.STOP]
STOPPED = EpisodeEnd(Verdict(EndReason.STOP, True, ""), 4, Fix(Pose(0.0, 0.0), PoseSource.ESTIMATED))


def ended(robot: RehearsalRobot | SimulatedRobot | StandInRobot, script: list[Action]) -> EpisodeEnd:
    plan = EpisodePlan(APARTMENT, "chair", APARTMENT.start(5), 4, PARAMETERS)
    with StopRequests() as stop:
        return run_episode(robot, ScriptedPolicy(list(script)), plan, MemoryRecorder(), NOBODY, stop)


def test_after_stop_a_robot_is_judged_by_the_pose_that_its_images_determine() -> None:
    drifts = NoiseSettings(odometry=OdometryNoise(way_scale_std=0.05, turn_scale_std=0.02))
    robot = RehearsalRobot(APARTMENT, SMALL, PARAMETERS, drifts)
    outcome = ended(robot, DRIVES)
    assert outcome.stop is not None
    assert outcome.final is not None
    assert outcome.stop.placement.method is PlacementMethod.DRIVE
    assert outcome.stop.placement.looks == 4, "the one after each movement, and the first"
    assert outcome.final.source is PoseSource.MEASURED
    true = robot._physics.pose
    assert outcome.final.pose.distance_to(true) < 0.05 < robot.locate().pose.distance_to(true)
    assert outcome.verdict.distance == outcome.stop.measured
    assert "(measured)" in outcome.verdict.text
    assert outcome.proposed, "a person confirms it"


def test_a_robot_whose_pose_is_known_and_one_without_a_stop_are_judged_as_ever() -> None:
    outcome = ended(SimulatedRobot(APARTMENT, SMALL, PARAMETERS), DRIVES[1:])
    assert outcome.stop is None
    assert outcome.final is not None
    assert outcome.final.source is PoseSource.SIMULATED
    meter = StopMeasurement(APARTMENT, "chair", PARAMETERS, Fix(Pose(0.0, 0.0), PoseSource.ESTIMATED))
    assert meter.judged(STOPPED) is STOPPED, "nothing was seen"
    meter.look(observation_of(0.0, PROFILE.camera, depth_m=None, pose=Pose(0.0, 0.0)))
    assert meter.judged(STOPPED) is STOPPED, "no depth"
    capped = replace(STOPPED, verdict=Verdict(EndReason.STEP_LIMIT, False, ""))
    assert meter.judged(capped) is capped


class Asking(AbsentOperator):
    """Asks once where the robot is, after its second action."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: list[bool] = []
        self.answers: list[str] = []

    def asks_where(self, *, can_measure: bool) -> bool:
        self.calls.append(can_measure)
        return len(self.calls) == 2

    def show_where(self, text: str) -> None:
        self.answers.append(text)


def test_a_person_can_ask_during_a_trial_where_the_robot_is() -> None:
    drifts = NoiseSettings(odometry=OdometryNoise(way_scale_std=0.05, turn_scale_std=0.02))
    robot, operator, recorder = RehearsalRobot(APARTMENT, SMALL, PARAMETERS, drifts), Asking(), MemoryRecorder()
    plan = EpisodePlan(APARTMENT, "chair", APARTMENT.start(5), 4, PARAMETERS)
    with StopRequests() as stop:
        outcome = run_episode(robot, ScriptedPolicy(list(DRIVES)), plan, recorder, operator, stop)
    assert operator.calls == [True] * len(DRIVES)
    (answer,) = operator.answers
    assert re.fullmatch(
        r"to the chair: measured .* m \(.*\), odometry .*; it is 0\.0\d m away from where its odometry says, and "
        r"turned \d\.\d° to the (left|right)",
        answer,
    )
    assert [text for kind, text in recorder.events if kind == "whereabouts"] == [answer]
    assert outcome.stop is not None
    assert outcome.stop.placement.looks == len(DRIVES), "its image does not count twice"


def wall_stop() -> tuple[DrivenWay, StopPose]:
    way, meter = drive(way_to_wall(APARTMENT, 0), SMALL, PARAMETERS, np.random.default_rng(3))
    stop = meter.measure()
    assert stop is not None
    return way, stop


def test_facing_a_bare_wall_the_place_along_it_is_unknown_and_the_odometry_stays() -> None:
    way, stop = wall_stop()
    assert stop.placement.fits
    assert stop.placement.undetermined == ("left-right",)
    assert stop.measured is None
    assert stop.judged.source is PoseSource.ESTIMATED
    assert stop.fix == Fix(stop.placement.mark, PoseSource.ESTIMATED)
    assert stop.text.startswith("not measured (the view does not determine left-right), odometry ")
    assert stop.odometry.range_m is not None
    assert stop.odometry.range_m[0] <= way.true_distance.distance_m <= stop.odometry.range_m[1]


@pytest.mark.parametrize("offset_m", [0.0, 1.5])
def test_a_pose_outside_the_search_is_no_pose(offset_m: float) -> None:
    start = APARTMENT.start(9).pose
    expected = start.compose(Pose(offset_m, 0.0))
    look = NoisyEye(APARTMENT, SMALL.camera, 1.0, np.random.default_rng(1)).look(start)
    meter = StopMeasurement(APARTMENT, "chair", PARAMETERS, Fix(expected, PoseSource.ESTIMATED))
    meter.look(observation_of(0.0, SMALL.camera, depth_m=look.depth_m, pose=Pose(0.0, 0.0)))
    stop = meter.measure()
    assert stop is not None
    assert (stop.measured is not None) == (offset_m == 0.0), stop.text


def stop_of(odometry_m: float, measured_m: float | None) -> StopPose:
    covariance = PoseCovariance(1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-5)
    undetermined = () if measured_m is not None else ("left-right",)
    placement = MeasuredPlacement(
        0, Pose(1.0, 0.0), Pose(1.0, 0.1), covariance, PlacementTolerance(), PlacementMethod.DRIVE, 5,
        undetermined=undetermined,
    )  # fmt: skip
    odometry = GoalDistance(odometry_m, PoseSource.ESTIMATED, "chair_1", range_m=(odometry_m - 0.2, math.inf))
    measured = GoalDistance(measured_m, PoseSource.MEASURED, "chair_1", range_m=(0.9, 1.1)) if measured_m else None
    return StopPose(placement, odometry, measured, 1.0)


def test_the_text_has_both_distances_and_whether_they_give_different_verdicts() -> None:
    differ = stop_of(0.87, 1.02)
    assert differ.verdicts_differ
    assert differ.text == (
        "measured 1.02 m (0.90 to 1.10), odometry 0.87 m (0.67 or more): they give different verdicts"
    )
    assert not stop_of(0.87, 0.93).verdicts_differ
    assert not stop_of(0.87, None).verdicts_differ
    assert range_text(GoalDistance(0.9999, PoseSource.TAPE), 1.0) == "0.9999 m"
