"""A Habitat agent receives Habitat's inputs, and its answers become protocol actions."""

import math
from typing import Any

import numpy as np
import pytest
import torch

from vsnbench.models.remote.vsnbench_policy import (
    Camera,
    Goal,
    HabitatAgent,
    Observation,
    Pose,
    WireError,
    checked_card,
    decision_of,
)

DEPTH_M = np.array([[0.2, 2.75, 9.0, np.nan, np.nan]], np.float32)
BEYOND = np.array([[False, False, False, False, True]])
TURN = {"0": "STOP", "1": "MOVE_FORWARD", "2": "TURN_LEFT", "3": "TURN_RIGHT"}


class Agent:
    """Returns scripted answers and keeps its inputs."""

    def __init__(self, answer: Any = 0) -> None:
        self.answer = answer

    def reset(self) -> None:
        pass

    def act(self, observations: dict[str, Any]) -> Any:
        self.seen = observations
        return self.answer


def look(heading_rad: float = 0.0, beyond_range: Any = None) -> Observation:
    return Observation(None, DEPTH_M, Pose(1.0, -0.5, heading_rad), 0.0, Camera({}), beyond_range)


def answered(answer: Any, actions: dict[str, str]) -> tuple[str, str]:
    agent = HabitatAgent(Agent, {"arguments": {"answer": answer}, "actions": actions})
    agent.reset("chair", 1)
    decision = decision_of(agent.act(look()))
    return decision["action"], decision["raw_action"]


@pytest.mark.parametrize(
    ("answer", "decision"),
    [
        (4, ("NOOP", "4")),
        (np.int64(5), ("MOVE_BACKWARD", "5")),
        ("look_down", ("NOOP", "look_down")),
        ({"action": 4, "action_args": {}}, ("NOOP", "4")),
        ({"action": "turn_left", "action_args": None}, ("TURN_LEFT", "turn_left")),
    ],
)
def test_looking_up_or_down_can_count_without_a_movement(answer: Any, decision: tuple[str, str]) -> None:
    assert answered(answer, {**TURN, "4": "NOOP", "5": "MOVE_BACKWARD", "look_down": "noop"}) == decision


@pytest.mark.parametrize("answer", [4, "look_up", {"action": "velocity_control", "action_args": {"linear": 1.0}}])
def test_an_action_that_is_not_mapped_is_refused_with_what_to_set(answer: Any) -> None:
    with pytest.raises(WireError, match=r'"actions": .*"NOOP"'):
        answered(answer, TURN)


@pytest.mark.parametrize("heading_rad", [0.0, math.pi, -math.pi, 3.2, -9.4, 100.0])
def test_the_compass_stays_within_half_a_turn(heading_rad: float) -> None:
    compass = HabitatAgent(Agent).observations(look(heading_rad))["compass"]
    assert compass.dtype == np.float32
    assert -math.pi <= float(compass[0]) <= math.pi
    assert math.cos(float(compass[0]) - heading_rad) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("normalize", "depth"), [(True, [0.0, 0.5, 1.0, 0.0, 1.0]), (False, [0.5, 2.75, 5.0, 0.5, 5.0])]
)
def test_depth_beyond_the_range_is_far_and_depth_that_is_missing_is_not(normalize: bool, depth: list[float]) -> None:
    agent = HabitatAgent(Agent, {"normalize_depth": normalize})
    np.testing.assert_allclose(agent.observations(look(beyond_range=BEYOND))["depth"][0, :, 0], depth)
    assert agent.observations(look())["depth"][0, 4, 0] == depth[0]


def seen_by(observation: Observation, wanted: Any = "chair", **settings: Any) -> dict[str, Any]:
    agent = HabitatAgent(Agent, settings)
    agent.reset(wanted, 1)
    agent.act(observation)
    seen: dict[str, Any] = agent.agent.seen
    return seen


def picture(height: int = 48, width: int = 64) -> Observation:
    rng = np.random.default_rng(4)
    rgb = rng.integers(0, 256, (height, width, 3), np.uint8)
    depth_m = rng.uniform(0.5, 5.0, (height, width)).astype(np.float32)
    return Observation(
        rgb, depth_m, Pose(0, 0, 0), 0.0, Camera({"width": width, "height": height, "horizontal_fov_deg": 90})
    )


def test_images_are_resized_and_cropped_as_habitat_baselines_does() -> None:
    shot = picture()
    seen = seen_by(shot, resize=30, crop=[24, 20], depth_min_m=0.0, normalize_depth=False)
    assert seen["rgb"].shape == (24, 20, 3)
    assert seen["depth"].shape == (24, 20, 1)
    for name, image in (("rgb", shot.rgb), ("depth", shot.depth_m[:, :, None])):
        tensor = torch.from_numpy(image.astype(np.float64)).permute(2, 0, 1)[None]
        resized = torch.nn.functional.interpolate(tensor, (30, 40), mode="area")[0].permute(1, 2, 0).numpy()
        expected = resized[3:27, 10:30].astype(image.dtype)
        np.testing.assert_allclose(seen[name], expected, atol=1 if name == "rgb" else 1e-6)
        assert seen[name].dtype == image.dtype


def test_intrinsics_are_those_of_the_resized_and_cropped_image() -> None:
    matrix = seen_by(picture(), resize=[24, 32], crop=[20, 20], intrinsics=True)["intrinsics"]
    np.testing.assert_allclose(matrix, [[16, 0, 10], [0, 16, 10], [0, 0, 1]], atol=1e-5)
    assert "intrinsics" not in seen_by(picture())


@pytest.mark.parametrize(
    ("pose", "polar"),
    [
        (Pose(0.0, 0.0, 0.0), (5.0, math.atan2(4, 3))),
        (Pose(3.0, 0.0, 0.0), (4.0, math.pi / 2)),
        (Pose(3.0, 0.0, math.pi), (4.0, -math.pi / 2)),
        (Pose(3.0, 4.0, 1.0), (0.0, None)),
    ],
)
def test_a_point_is_told_from_where_the_robot_stands(pose: Pose, polar: tuple[float, float | None]) -> None:
    goal = Goal("there")
    goal.point = (3.0, 4.0)
    shot = picture()
    shot.pose = pose
    seen = seen_by(shot, goal, goal="pointgoal_with_gps_compass")["pointgoal_with_gps_compass"]
    assert (seen.dtype, float(seen[0])) == (np.float32, pytest.approx(polar[0], abs=1e-6))
    assert polar[1] is None or float(seen[1]) == pytest.approx(polar[1], abs=1e-6)


def test_an_agent_with_image_or_instruction_goals_gets_them_as_habitat_names_them() -> None:
    goal = Goal("photo")
    goal.image, goal.text = picture(96, 128).rgb, ""
    seen = seen_by(picture(), goal, goal="imagegoal", resize=[24, 32])
    assert seen["imagegoal"].shape == seen["rgb"].shape == (24, 32, 3)
    assert "objectgoal" not in seen
    spoken = Goal("leave the room")
    spoken.text = "leave the room"
    assert seen_by(picture(), spoken, goal="instruction")["instruction"] == {"text": "leave the room"}
    assert checked_card(HabitatAgent(Agent, {"goal": "instruction"}))["goal_kinds"] == ["instruction", "text"]


@pytest.mark.parametrize("settings", [{"goal": "pointgoal"}, {"crop": [480, 20]}])
def test_settings_that_cannot_be_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"goal must be one of|crop \[480, 20\] is larger"):
        seen_by(picture(), **settings)
