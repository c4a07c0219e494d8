"""Placement: measured, corrected and measured again; the measured pose starts the trajectory."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from tests.runner.episode.test_episode import MemoryRecorder
from tests.runner.stand_ins import APARTMENT, PROFILE, StandInRobot
from vsnbench.errors import NotPlacedError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.files.mark_photos import MarkPhotos
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.rehearsal import RehearsalRobot
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.step import EpisodePlan
from vsnbench.runner.operator.contract import AbsentOperator
from vsnbench.runner.operator.placing import Placing
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.sites.site import StartingPosition
from vsnbench.values.decision import Decision
from vsnbench.values.fix import PoseSource
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose

START = APARTMENT.start(5)
PARAMETERS = ProtocolParameters(max_actions=6)
TURTLEBOT = load_profile("turtlebot2")


@pytest.fixture(scope="module")
def robot() -> RehearsalRobot:
    camera = TURTLEBOT.camera.resized(160, 120)
    return RehearsalRobot(APARTMENT, TURTLEBOT.model_copy(update={"camera": camera}), PARAMETERS)


def placing_of(robot: RehearsalRobot | StandInRobot, seed: int = 1) -> Placing:
    return Placing(robot, APARTMENT, START, seed, PARAMETERS, StopRequests())


def test_a_rehearsal_begins_at_the_measured_pose(robot: RehearsalRobot) -> None:
    placing = placing_of(robot)
    looks = [placing.look()]
    while looks[-1].measured is None or not looks[-1].measured.within_tolerance:
        assert len(looks) < 6, [look.measured and look.measured.headline for look in looks]
        placing.moved()
        assert placing.last is None, "a measurement before the move is no longer valid"
        looks.append(placing.look())
    first, last = looks[0].measured, looks[-1].measured
    assert first is not None
    assert last is not None
    assert first.pose.distance_to(START.pose) > last.pose.distance_to(START.pose)
    fix = placing.begin()
    assert fix.source is PoseSource.MEASURED
    assert fix.pose.distance_to(robot._physics.pose) < 0.03
    assert robot.locate().pose.distance_to(fix.pose) < 1e-6, "the estimated trajectory begins there"
    assert robot.locate().source is PoseSource.ESTIMATED


def test_without_a_look_the_robot_is_assumed_at_its_mark(robot: RehearsalRobot) -> None:
    fix = placing_of(robot, seed=2).begin()
    assert fix.source is PoseSource.ESTIMATED
    assert fix.pose.distance_to(START.pose) < 1e-9
    assert robot._physics.pose.distance_to(START.pose) > 0.01


def test_view_overlay_and_first_photo_match(robot: RehearsalRobot, tmp_path: Path) -> None:
    import cv2
    import numpy as np

    results = ResultsDirectory.locate(tmp_path)
    photos = MarkPhotos(results, robot.profile)
    placing = Placing(robot, APARTMENT, START, 3, PARAMETERS, StopRequests(), lambda: photos.find(APARTMENT, START))
    look = placing.look()
    assert look.photo_jpeg is None
    photos.keep(APARTMENT, START, look.picture_jpeg)
    photos.keep(APARTMENT, START, b"a later one")
    assert placing.look().photo_jpeg == look.picture_jpeg, "the first one stays"
    assert look.ghost_png is not None
    ghost = cv2.imdecode(np.frombuffer(look.ghost_png, np.uint8), cv2.IMREAD_UNCHANGED)
    assert ghost.shape == (120, 160, 4)
    share = (ghost[..., 3] > 0).mean()
    assert 0.005 < share < 0.5, "edges, and nothing else"
    look.write_overlay(tmp_path / "over.png")
    assert (tmp_path / "over.png").read_bytes().startswith(b"\x89PNG")


def test_a_robot_that_is_not_placed_reports_a_problem() -> None:
    class Lifted(StandInRobot):
        def begin(self, start: StartingPosition, seed: int) -> None:
            raise NotPlacedError("the base still reports: wheel drop")

    look = placing_of(Lifted()).look()
    assert look.problem == "the base still reports: wheel drop"
    assert look.measured is None
    assert look.ghost_png is None


def test_a_robot_without_a_depth_camera_cannot_measure() -> None:
    class Flat(StandInRobot):
        def observe(self) -> Observation:
            return replace(super().observe(), depth_m=None)

    robot = Flat(sensors=frozenset({Sensor.RGB}))
    placing = placing_of(robot)
    assert not placing.can_measure
    assert "no depth image" in placing.look().problem


def test_the_verdict_of_a_rehearsal_awaits_judgement(robot: RehearsalRobot) -> None:
    class StopAtOnce(Policy):
        card = ModelCard("stop-at-once")

        def reset(self, goal: str, seed: int) -> None:
            pass

        def act(self, observation: Observation) -> Decision:
            return Decision(Action.STOP)

    plan = EpisodePlan(APARTMENT, "chair", START, 4, PARAMETERS)
    with StopRequests() as stop:
        outcome = run_episode(robot, StopAtOnce(), plan, MemoryRecorder(), AbsentOperator(), stop)
    assert outcome.proposed
    assert robot.identity.simulated, "and it is recorded as simulated"
    assert robot.conditions["pretends_to_be_real"] is True
    assert outcome.final is not None
    assert outcome.final.source is PoseSource.MEASURED, "from the depth image after STOP"


def test_a_robot_moved_after_its_measurement_is_measured_again() -> None:
    class Pushed(StandInRobot):
        def begin(self, start: StartingPosition, seed: int) -> None:
            self.begun_with = (start.number, seed)

    robot = Pushed(profile=PROFILE, place=START.pose)
    placing = placing_of(robot)
    placing.look()
    looks = robot.looks
    robot.place = Pose(robot.place.x_m + 0.05, robot.place.y_m, math.radians(2))
    placing.begin()
    assert robot.looks == looks + 1
