"""Detectors: degraded simulator labels, an ONNX file, and the choice between them."""

import json
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from tests.models.vlv.looks import look
from vsnbench.errors import ModelError, UsageError
from vsnbench.models.vlv.detectors.choosing import open_detector
from vsnbench.models.vlv.detectors.contract import Reliability
from vsnbench.models.vlv.detectors.mask_pasting import paste_mask
from vsnbench.models.vlv.detectors.onnx_detector import ONNXDetector
from vsnbench.models.vlv.detectors.simulated import SimulatedDetector
from vsnbench.models.vlv.policy import VLV
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.values.observation import Observation

THINGS = (("sofa", (50, 90, 20, 60), 2.0), ("wardrobe", (20, 90, 100, 150), 3.0))


def simulated(**settings: float) -> SimulatedDetector:
    return SimulatedDetector(VLVSettings.model_validate(settings))


def test_the_simulated_detector_finds_its_share_of_what_is_there() -> None:
    detector = simulated(simulated_recall=0.7, simulated_precision=1.0)
    detector.begin(1)
    found = [len(detector.detect(look(*THINGS))) for _ in range(400)]
    assert set(found) == {0, 1}
    assert np.mean(found) == pytest.approx(0.7, abs=0.07)


def test_and_is_right_in_its_share_of_what_it_finds() -> None:
    detector = simulated(simulated_recall=1.0, simulated_precision=0.8)
    detector.begin(1)
    found = [each for _ in range(400) for each in detector.detect(look(*THINGS))]
    right = [each for each in found if each.label == "couch" and each.mask[60, 40]]
    assert len(right) / len(found) == pytest.approx(0.8, abs=0.03)


def test_a_perfect_one_gives_the_object_s_own_pixels() -> None:
    detector = simulated(simulated_recall=1.0, simulated_precision=1.0, simulated_box_error=0.0)
    (found,) = detector.detect(look(*THINGS))
    assert (found.label, found.box) == ("couch", (20.0, 50.0, 60.0, 90.0))
    assert np.count_nonzero(found.mask) == 40 * 40
    assert found.mask[50:90, 20:60].all()


def test_what_is_too_far_or_too_small_is_never_found() -> None:
    assert simulated(simulated_recall=1.0, simulated_range_m=1.9).detect(look(*THINGS)) == ()
    assert simulated(simulated_recall=1.0, simulated_min_area=0.2).detect(look(*THINGS)) == ()


def test_the_seed_decides_what_is_missed() -> None:
    def found(seed: int) -> list[int]:
        detector = simulated(simulated_recall=0.5)
        detector.begin(seed)
        return [len(detector.detect(look(*THINGS))) for _ in range(40)]

    assert found(7) == found(7)
    assert found(7) != found(8)


def test_it_says_what_it_needs_where_there_is_no_simulator() -> None:
    seen = look(*THINGS)
    real = Observation(seen.rgb, seen.depth_m, seen.pose, 0.0, seen.camera)
    with pytest.raises(ModelError, match="simulated robots only"):
        simulated().detect(real)


def save_onnx(
    path: Path, names: str = "", outputs: tuple[str, ...] = ("boxes", "labels", "scores", "masks"), **metadata: str
) -> Path:
    """Write a detector that finds the same two objects in every image."""
    values = {
        "boxes": np.array([[10, 20, 50, 80], [60, 10, 90, 40]], np.float32),
        "labels": np.array([63, 70], np.int64),
        "scores": np.array([0.4, 0.9], np.float32),
        "masks": np.ones((2, 1, 28, 28), np.float32),
    }
    nodes = [helper.make_node("ReduceMean", ["image"], ["unused"], keepdims=0)]
    infos = [helper.make_tensor_value_info("unused", TensorProto.FLOAT, [])]
    for name in outputs:
        value = values.get(name, np.zeros(1, np.float32))
        nodes.append(helper.make_node("Constant", [], [name], value=onnx.numpy_helper.from_array(value, name)))
        kind = TensorProto.INT64 if name == "labels" else TensorProto.FLOAT
        infos.append(helper.make_tensor_value_info(name, kind, list(value.shape)))
    image = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, "H", "W"])
    graph = helper.make_graph(nodes, "detector", [image], infos)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    helper.set_model_props(model, metadata | ({"names": names} if names else {}))
    onnx.save(model, path)
    return path


def test_an_onnx_file_s_answers_become_detections(tmp_path: Path) -> None:
    detector = ONNXDetector(save_onnx(tmp_path / "d.onnx"), 0.3)
    best, other = detector.detect(look())
    assert (best.label, other.label) == ("toilet", "couch")
    assert best.score == pytest.approx(0.9)
    assert best.box == (60.0, 10.0, 90.0, 40.0)
    assert best.mask[25, 75]
    assert not best.mask[25, 30]
    assert len(detector.weights_sha256) == 64


def test_scores_under_the_threshold_are_left_out(tmp_path: Path) -> None:
    assert len(ONNXDetector(save_onnx(tmp_path / "d.onnx"), 0.5).detect(look())) == 1


def test_the_file_s_own_class_names_are_used(tmp_path: Path) -> None:
    path = save_onnx(tmp_path / "d.onnx", "{63: 'sofa', 70: 'chair'}")
    detector = ONNXDetector(path, 0.3)
    assert [each.label for each in detector.detect(look())] == ["chair", "couch"]


WEAK = json.dumps({"couch": {"threshold": 0.35, "precision": 0.6, "recall": 0.3}})


def test_the_file_s_own_minimum_scores_are_used_and_recorded(tmp_path: Path) -> None:
    path = save_onnx(tmp_path / "d.onnx", title="Small net", reliability=WEAK)
    detector = ONNXDetector(path, 0.5)
    assert [each.label for each in detector.detect(look())] == ["toilet", "couch"]
    assert detector.name == "Small net (d.onnx)"
    assert detector.settings["thresholds"] == {"couch": 0.35}
    assert detector.reliability("toilet") == Reliability(0.5)


def test_a_minimum_score_in_the_settings_replaces_the_file_s(tmp_path: Path) -> None:
    path = save_onnx(tmp_path / "d.onnx", reliability=WEAK)
    detector = open_detector(VLVSettings(detector_weights=str(path), detector_threshold=0.5), "cpu")
    assert detector.reliability("couch") == Reliability(0.5)


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"couch": {}}',
        '{"couch": {"threshold": 0.3, "precision": 1.0, "recall": 0.3}}',
        f'{{"couch": {{"threshold": 1{"0" * 400}, "precision": 0.5, "recall": 0.3}}}}',
    ],
    ids=["not JSON", "list", "empty", "certain", "huge"],
)
def test_a_reliability_that_cannot_be_read_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ModelError, match="reliability"):
        ONNXDetector(save_onnx(tmp_path / "d.onnx", reliability=text), 0.5)


def test_less_precise_classes_need_more_views_and_rarely_seen_ones_allow_misses() -> None:
    assert [Reliability.measured(0.3, precision, 0.5).views_to_believe for precision in (0.95, 0.6, 0.4)] == [2, 4, 6]
    assert [Reliability.measured(0.3, 0.6, recall).miss_weight for recall in (0.8, 0.5, 0.2)] == [1.0, 0.5, 0.125]


def test_without_masks_depth_finds_the_object_in_the_box(tmp_path: Path) -> None:
    path = save_onnx(tmp_path / "d.onnx", outputs=("boxes", "labels", "scores"))
    seen = look(("sofa", (30, 80, 15, 40), 2.0), wall_m=4.0)  # narrower than its box, before a wall
    (found,) = [each for each in ONNXDetector(path, 0.3).detect(seen) if each.label == "couch"]
    assert found.mask[50, 30]
    assert not found.mask[50, 44]


def test_a_detector_that_cannot_find_a_goal_is_refused_for_it(tmp_path: Path) -> None:
    path = save_onnx(tmp_path / "d.onnx", "{63: 'sofa', 70: 'person'}")
    vlv = VLV(model_config=VLVSettings(detector_weights=str(path)))
    assert vlv.card.goals == {"sofa"}
    with pytest.raises(UsageError, match="toilet"):
        vlv.reset("toilet", 0)


def test_one_that_finds_no_goal_at_all_is_refused_at_once(tmp_path: Path) -> None:
    path = save_onnx(tmp_path / "d.onnx", "['person', 'dog']")
    with pytest.raises(ModelError, match="finds none of"):
        VLV(model_config=VLVSettings(detector_weights=str(path)))


def test_one_with_foreign_classes_only_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="none of its 2 classes"):
        ONNXDetector(save_onnx(tmp_path / "d.onnx", "['Katze', 'Hund']"), 0.5)


def test_an_onnx_file_that_is_no_detector_is_refused(tmp_path: Path) -> None:
    path = save_onnx(tmp_path / "d.onnx", outputs=("logits",))
    with pytest.raises(ModelError, match=r"not a detector.*logits"):
        ONNXDetector(path, 0.5)


def test_a_file_that_is_not_onnx_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "d.onnx"
    path.write_bytes(b"<html>log in first</html>")
    with pytest.raises(ModelError, match="cannot load"):
        ONNXDetector(path, 0.5)


def test_the_ending_of_the_file_says_which_detector_is_meant(tmp_path: Path) -> None:
    settings = VLVSettings(detector_weights=str(save_onnx(tmp_path / "d.onnx")))
    assert open_detector(settings, "cpu").name.startswith("ONNX detector")


def test_a_mask_is_laid_over_its_box_and_cut_at_the_image_s_border() -> None:
    mask = np.ones((28, 28), np.float32)
    whole = paste_mask(mask, (10.0, 20.0, 50.0, 80.0), (120, 160))
    assert whole[22:78, 12:48].all()
    assert np.count_nonzero(whole) == pytest.approx(40 * 60, rel=0.1)
    assert np.count_nonzero(paste_mask(mask, (-20.0, -20.0, 20.0, 20.0), (120, 160))) == pytest.approx(400, rel=0.15)
    assert not paste_mask(mask, (200.0, 20.0, 240.0, 60.0), (120, 160)).any()


def test_missing_weights_are_warned_of_once_for_all_conditions_of_a_sweep(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("VSNBENCH_WEIGHTS", str(tmp_path))
    for _ in range(3):
        assert isinstance(open_detector(VLVSettings(), "cpu"), SimulatedDetector)
    assert sum(str(tmp_path) in record.message for record in caplog.records) == 1
