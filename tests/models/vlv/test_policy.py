"""VLV as a policy: stopping, looking around, refusals and diagnostics."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from tests.models.vlv.looks import look
from vsnbench.errors import ModelError, UsageError
from vsnbench.models.registry import create_policy
from vsnbench.models.vlv.policy import VLV
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose

PERFECT = VLVSettings(simulated_recall=1.0, simulated_precision=1.0)
NEAR_SOFA = ("sofa", (50, 110, 30, 130), 0.7)


def policy(goal: str = "sofa", settings: VLVSettings = PERFECT) -> VLV:
    made = VLV(model_config=settings)
    made.reset(goal, seed=1)
    return made


def test_stops_at_the_second_look_at_a_near_goal_and_not_at_the_first() -> None:
    vlv = policy()
    assert vlv.act(look(NEAR_SOFA)).action is not Action.STOP
    assert vlv.act(look(NEAR_SOFA)).action is Action.STOP


def test_the_card_names_the_device_of_the_networks_and_not_the_requested_one() -> None:
    assert VLV(model_config=PERFECT, device="auto").card.runs_on == {"device": "cpu"}


def test_looks_in_a_row_are_meant() -> None:
    vlv = policy()
    for seen in (look(NEAR_SOFA), look(wall_m=0.8), look(NEAR_SOFA)):
        assert vlv.act(seen).action is not Action.STOP


def test_never_stops_at_something_else_or_at_a_goal_too_far_away() -> None:
    for thing in (("chair", (50, 110, 30, 130), 0.7), ("sofa", (50, 110, 30, 130), 1.3)):
        vlv = policy()
        actions = [vlv.act(look(thing)).action for _ in range(6)]
        assert Action.STOP not in actions


def test_a_goal_without_valid_depth_is_never_near() -> None:
    vlv = policy()
    assert Action.STOP not in [vlv.act(look(("sofa", (20, 119, 0, 159), math.nan))).action for _ in range(20)]


def turned(k: int, sign: int = 1) -> Observation:
    return look(pose=Pose(0, 0, sign * k * math.pi / 6))


def test_looks_around_in_twelve_left_turns_before_it_goes_anywhere() -> None:
    vlv = policy()
    actions = [vlv.act(turned(k)).action for k in range(13)]
    assert actions[:12] == [Action.TURN_LEFT] * 12
    decision = vlv.act(turned(13))
    assert decision.diagnostics.sub_goal is not None
    assert len(decision.diagnostics.nodes) == 1


def test_alternating_scans_turn_back_what_the_last_one_turned() -> None:
    settings = PERFECT.model_copy(update={"scan_direction": "alternate", "scan_turns": 3})
    vlv = policy(settings=settings)
    first = [vlv.act(look(wall_m=0.6)).action for _ in range(3)]
    second = [vlv.act(look(wall_m=0.6)).action for _ in range(3)]
    assert set(first) == {Action.TURN_LEFT}
    assert set(second) == {Action.TURN_RIGHT}


def test_the_sub_goal_lies_one_and_a_half_metres_off_where_nothing_stands_in_the_way() -> None:
    vlv = policy()
    for k in range(12):
        vlv.act(turned(k))
    sub_goal = vlv.act(turned(12)).diagnostics.sub_goal
    assert sub_goal is not None
    assert math.hypot(*sub_goal) == pytest.approx(1.5)


@pytest.mark.parametrize("wall_m", [1.2, 1.5, 1.7, 2.0, 2.6])
def test_no_sub_goal_lies_in_or_behind_a_wall(wall_m: float) -> None:
    vlv = policy()
    for k in range(12):
        vlv.act(look(pose=Pose(0, 0, k * math.pi / 6), wall_m=wall_m))
    sub_goal = vlv.act(look(pose=Pose(0, 0, 2 * math.pi), wall_m=wall_m)).diagnostics.sub_goal
    # Twelve walls at `wall_m` from the middle: nothing is farther than their corners.
    assert sub_goal is None or math.hypot(*sub_goal) < wall_m


HARD_FRAMES = {
    "through a door": lambda: look(("bed", (55, 75, 74, 86), 5.0), wall_m=2.0),
    "behind dropouts like glass": lambda: _glass(look(("bed", (40, 100, 40, 120), 3.0))),
    "at the left border": lambda: look(("bed", (50, 100, 0, 6), 2.5)),
    "at the lower right corner": lambda: look(("bed", (112, 120, 150, 160), 0.9)),
    "over the whole image": lambda: look(("bed", (0, 120, 0, 160), 0.5)),
    "of one row": lambda: look(("bed", (70, 71, 0, 160), 2.0)),
    "with no depth at all": lambda: look(("bed", (0, 120, 0, 160), math.nan)),
}


def _glass(seen: Observation) -> Observation:
    depth = np.array(seen.depth_m)
    depth[np.random.default_rng(3).random(depth.shape) < 0.8] = np.nan
    return Observation(seen.rgb, depth.astype(np.float32), seen.pose, seen.stamp_s, seen.camera, seen.instances)


@pytest.mark.parametrize("name", HARD_FRAMES)
def test_hard_frames_neither_break_it_nor_send_it_into_a_wall(name: str) -> None:
    vlv = policy("bed", PERFECT.model_copy(update={"simulated_min_area": 0.0, "simulated_range_m": 10.0}))
    frame = HARD_FRAMES[name]()
    for k in range(30):
        seen = Observation(
            frame.rgb,
            frame.depth_m,
            Pose(0, 0, (k % 12) * math.pi / 6),
            0.0,
            frame.camera,
            frame.instances,
        )
        decision = vlv.act(seen)
        grid = decision.diagnostics.map
        for point in decision.diagnostics.path:
            assert grid is not None
            row = math.floor((point[1] - grid.origin_y_m) / grid.resolution_m)
            column = math.floor((point[0] - grid.origin_x_m) / grid.resolution_m)
            if 0 <= row < grid.cells.shape[0] and 0 <= column < grid.cells.shape[1]:
                assert grid.cells[row, column] != 2


def test_the_same_seed_makes_the_same_decisions() -> None:
    def run(seed: int) -> list[tuple[str, str]]:
        vlv = VLV()
        vlv.reset("sofa", seed)
        thing = ("sofa", (50, 90, 60, 100), 2.5)
        decisions = [vlv.act(look(thing, pose=Pose(0, 0, k * math.pi / 6))) for k in range(15)]
        return [(each.action.value, str(each.diagnostics.boxes)) for each in decisions]

    assert run(5) == run(5)
    assert run(5) != run(6)


def test_the_card_states_the_simulated_detector_and_the_missing_value_network() -> None:
    card = VLV().card
    assert "simulated detector" in card.weights_label
    assert "no value network" in card.weights_label
    assert Sensor.INSTANCES in card.sensors
    assert Sensor.DEPTH in card.sensors
    assert Sensor.RGB not in card.sensors, "neither the detector nor the value reads the colours"
    assert card.goals == {"chair", "sofa", "table", "bed", "toilet"}
    assert json.loads(json.dumps(dict(card.settings)))["detector"] == "simulated"


def test_diagnostics_can_be_kept() -> None:
    vlv = policy()
    for k in range(13):
        decision = vlv.act(look(("sofa", (50, 90, 60, 100), 2.5), pose=Pose(0, 0, k * math.pi / 6)))
        json.dumps(dict(decision.diagnostics.details))
        assert decision.diagnostics.map is not None
        assert decision.diagnostics.boxes[0].label == "sofa"


def test_no_depth_camera_is_said(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="depth"):
        policy().act(look(depth=False))


def test_an_unknown_goal_is_refused() -> None:
    with pytest.raises(UsageError, match="plant"):
        VLV().reset("plant", 0)


def test_acting_before_an_episode_is_refused() -> None:
    with pytest.raises(ModelError, match="reset"):
        VLV().act(look())


def test_an_unknown_setting_is_refused_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "vlv.yaml"
    file.write_text("sub_goal: sampled\nsub_gaol_m: 2\n")
    with pytest.raises(UsageError, match=r"vlv\.yaml:2"):
        create_policy("vlv", model_config=file)


def test_a_missing_detector_file_is_said_before_anything_moves(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="no detector at"):
        VLV(model_config=VLVSettings(detector_weights=str(tmp_path / "none.onnx")))


def test_the_paper_s_detector_without_its_weights_says_where_they_belong() -> None:
    with pytest.raises(ModelError, match=r"vlv_mask_rcnn\.pth"):
        VLV(model_config=VLVSettings.model_validate({"detector": "mask_rcnn"}))
