"""Frames of blocked actions, movements with parameters, and steps without odometry."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.report.records import Attempt, Lab
from vsnbench.errors import UsageError
from vsnbench.interop.episodes import read_episodes
from vsnbench.interop.lerobot.frames import ACTIONS, CAMERA, NOT_EXPORTABLE, EpisodeFrames, frames_of, task_text
from vsnbench.results.model import Episode
from vsnbench.values.goal import GoalKind
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action, Waypoint
from vsnbench.values.pose import Pose
from vsnbench.values.step import StepRecord

AHEAD = Pose(1.0, 2.0, math.pi / 2)
STEPS = [
    StepRecord(1, Action.TURN_LEFT, result=MotionResult(True, pose=AHEAD), observed=Pose(1.0, 2.0, 0.0), stamp_s=5.0),
    StepRecord(2, Action.MOVE_FORWARD, observed=AHEAD, stamp_s=7.5),
    StepRecord(
        3,
        Action.WAYPOINT,
        movement=Waypoint(1.0, 0.5),
        result=MotionResult(False, pose=Pose(0.7, 2.8, math.pi), blocked="an obstacle"),
        observed=AHEAD,
        stamp_s=8.0,
    ),
    StepRecord(4, Action.STOP, result=MotionResult(True, pose=AHEAD), observed=AHEAD, stamp_s=9.0),
]


@pytest.fixture
def episode(tmp_path: Path) -> Episode:
    """An episode with four images and no depth."""
    lab = Lab(tmp_path)
    lab.write([Attempt(steps=STEPS)])
    (found,) = read_episodes(lab.engine())
    (tmp_path / "kept/rgb").mkdir(parents=True)
    for number in range(1, 5):
        assert cv2.imwrite(str(tmp_path / f"kept/rgb/{number:04d}.jpg"), np.zeros((4, 6, 3), np.uint8))
    return replace(found, images_directory="kept")


def frames(
    episode: Episode, root: Path, steps: Sequence[StepRecord] = STEPS, *, with_depth: bool = False
) -> EpisodeFrames:
    return frames_of(episode, steps, root, with_depth=with_depth)


def test_actions_are_what_the_robot_did_in_its_own_frame(episode: Episode, tmp_path: Path) -> None:
    found = frames(episode, tmp_path)
    assert found.action.tolist() == [
        pytest.approx([0, 0, math.pi / 2, 0], abs=1e-6),
        [0, 0, 0, 0],
        pytest.approx([0.8, 0.3, math.pi / 2, 0], abs=1e-6),
        [0, 0, 0, 1],
    ]
    assert found.blocked.tolist() == [False, True, True, False]
    assert [ACTIONS[index] for index in found.discrete_action] == [step.action for step in STEPS]
    assert found.robot_time_s.tolist() == [0, 2.5, 3, 4]
    assert {name: images.sizes for name, images in found.images.items()} == {CAMERA: {(6, 4)}}


def refused(episode: Episode, root: Path, steps: Sequence[StepRecord] = STEPS, *, with_depth: bool) -> str:
    with pytest.raises(UsageError) as error:
        frames(episode, root, steps, with_depth=with_depth)
    assert error.value.code in NOT_EXPORTABLE
    return error.value.code


def test_an_episode_that_misses_something_has_a_reason(episode: Episode, tmp_path: Path) -> None:
    assert refused(replace(episode, success=None), tmp_path, with_depth=False) == "unjudged-episode"
    assert refused(episode, tmp_path, [], with_depth=False) == "no-steps"
    assert refused(episode, tmp_path, [replace(STEPS[0], observed=None)], with_depth=False) == "no-odometry"
    assert refused(episode, tmp_path, with_depth=True) == "no-depth"
    (tmp_path / "kept/rgb/0003.jpg").write_bytes(b"")
    assert refused(episode, tmp_path, with_depth=False) == "no-images"
    assert refused(replace(episode, images_directory=""), tmp_path, with_depth=False) == "no-images"


def test_tasks_are_sentences(episode: Episode) -> None:
    assert task_text(replace(episode, goal="potted_plant")) == "find a potted plant"
    assert task_text(replace(episode, goal="oven")) == "find an oven"
    words = replace(episode, goal="x", goal_kind=GoalKind.INSTRUCTION, goal_text="go out and wait")
    assert task_text(words) == "go out and wait"
