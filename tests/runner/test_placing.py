"""A robot put at its mark: measured, mended, measured again; what is known then is where its trajectory begins."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from tests.runner.stand_ins import APARTMENT, PROFILE, QuietDisplay, StandInRobot
from tests.runner.test_episode import MemoryRecorder
from vsnbench.errors import NotPlacedError
from vsnbench.models.contract import ModelCard
from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Decision
from vsnbench.protocol.fix import PoseSource
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.site import StartingPosition
from vsnbench.record.mark_photos import MarkPhotos
from vsnbench.record.results import ResultsDirectory
from vsnbench.robots.pretended import PretendedRobot
from vsnbench.robots.profiles import load_profile
from vsnbench.runner.attendant import Nobody
from vsnbench.runner.episode import EpisodePlan, run_episode
from vsnbench.runner.placing import Placing
from vsnbench.runner.stopping import Stopping

START = APARTMENT.start(5)
PARAMETERS = ProtocolParameters(max_actions=6)
TURTLEBOT = load_profile("turtlebot2")


@pytest.fixture(scope="module")
def robot() -> PretendedRobot:
    camera = TURTLEBOT.camera.resized(160, 120)
    return PretendedRobot(APARTMENT, TURTLEBOT.model_copy(update={"camera": camera}), PARAMETERS)


def placing_of(robot: PretendedRobot | StandInRobot, seed: int = 1) -> Placing:
    return Placing(robot, APARTMENT, START, seed, PARAMETERS, Stopping())


def test_a_pretended_robot_is_measured_mended_and_begins_where_it_was_measured(robot: PretendedRobot) -> None:
    placing = placing_of(robot)
    assert placing.pretended
    looks = [placing.look()]
    while looks[-1].measured is None or not looks[-1].measured.within_tolerance:
        assert len(looks) < 6, [look.measured and look.measured.headline for look in looks]
        placing.moved()
        assert placing.last is None, "what was measured before it was moved says nothing now"
        looks.append(placing.look())
    first, last = looks[0].measured, looks[-1].measured
    assert first is not None
    assert last is not None
    assert first.pose.distance_to(START.pose) > last.pose.distance_to(START.pose)
    fix = placing.begin()
    assert fix.source is PoseSource.MEASURED
    assert fix.pose.distance_to(robot.true_pose) < 0.03
    assert robot.locate().pose.distance_to(fix.pose) < 1e-6, "the estimated trajectory begins there"
    assert robot.locate().source is PoseSource.ESTIMATED


def test_whoever_goes_without_a_look_is_taken_to_stand_at_the_mark(robot: PretendedRobot) -> None:
    fix = placing_of(robot, seed=2).begin()
    assert fix.source is PoseSource.ESTIMATED
    assert fix.pose.distance_to(START.pose) < 1e-9
    assert robot.true_pose.distance_to(START.pose) > 0.01


def test_the_picture_the_ghost_and_the_photo_lie_over_each_other(robot: PretendedRobot, tmp_path: Path) -> None:
    import cv2
    import numpy as np

    results = ResultsDirectory.locate(tmp_path)
    photos = MarkPhotos(results, robot.profile)
    placing = Placing(robot, APARTMENT, START, 3, PARAMETERS, Stopping(), lambda: photos.find(APARTMENT, START))
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


def test_a_robot_that_does_not_stand_is_no_look_but_a_problem() -> None:
    class Lifted(StandInRobot):
        def begin(self, start: StartingPosition, seed: int) -> None:
            raise NotPlacedError("the base still reports: wheel drop")

    look = placing_of(Lifted()).look()
    assert look.problem == "the base still reports: wheel drop"
    assert look.measured is None
    assert look.ghost_png is None


def test_a_robot_without_a_depth_camera_says_so() -> None:
    class Flat(StandInRobot):
        def observe(self) -> Observation:
            return replace(super().observe(), depth_m=None)

    robot = Flat(sensors=frozenset({Sensor.RGB}))
    placing = placing_of(robot)
    assert not placing.can_measure
    assert "no depth image" in placing.look().problem


def test_a_rehearsal_s_verdict_awaits_a_person(robot: PretendedRobot) -> None:
    class StopAtOnce:
        card = ModelCard("stop-at-once")

        def reset(self, goal: str, seed: int) -> None:
            pass

        def act(self, observation: Observation) -> Decision:
            return Decision(Action.STOP)

    plan = EpisodePlan(APARTMENT, "chair", START, 4, PARAMETERS)
    with Stopping() as stop:
        outcome = run_episode(robot, StopAtOnce(), plan, MemoryRecorder(), Nobody(QuietDisplay()), stop)
    assert outcome.proposed
    assert robot.identity.simulated, "and it is recorded as what it is"
    assert robot.conditions["pretends_to_be_real"] is True
    assert outcome.final is not None
    assert outcome.final.source is PoseSource.ESTIMATED


def test_a_robot_that_is_pushed_after_it_was_measured_is_measured_again() -> None:
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
