"""The value network gives the original's recorded values, and refuses other files."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import torch
from torch import Tensor

from tests.models.vlv.conftest import DATA
from vsnbench.errors import ModelError
from vsnbench.models.vlv.goals import VALUE_CLASSES
from vsnbench.models.vlv.policy import VLV
from vsnbench.models.vlv.value.estimate import open_value
from vsnbench.models.vlv.value.network import build_value_network, q_values
from vsnbench.models.vlv.value.weights import read_value_weights


def test_answers_as_the_original_to_a_ten_thousandth(value_file: Path, frames: npt.NDArray[np.uint8]) -> None:
    expected = np.load(DATA / "vlv" / "expected.npz")["q"]
    network = build_value_network(read_value_weights(value_file).tensors)
    answers = np.stack([q_values(network, frame) for frame in frames])
    assert answers.shape == expected.shape == (6, 5, 3)
    assert np.abs(answers - expected).max() <= 1e-4 * np.abs(expected).max()


def test_the_value_of_a_view_is_the_best_action_s(value_file: Path, frames: npt.NDArray[np.uint8]) -> None:
    expected = np.load(DATA / "vlv" / "expected.npz")["q"]
    value = open_value(value_file, "cpu")
    assert value.of(frames[2], "couch") == pytest.approx(
        expected[2, VALUE_CLASSES.index("couch")].max(), rel=1e-4, abs=1e-2
    )


def test_a_camera_image_is_brought_to_the_network_s_size(value_file: Path) -> None:
    value = open_value(value_file, "cpu")
    image = np.random.default_rng(5).integers(0, 255, (480, 640, 3), np.uint8)
    assert np.isfinite(value.of(image, "bed"))
    assert value.of(image, "bed") != value.of(255 - image, "bed")


def test_without_weights_every_view_is_worth_nothing_and_the_label_says_so(frames: npt.NDArray[np.uint8]) -> None:
    value = open_value(None, "cpu")
    assert value.of(frames[0], "bed") == 0.0
    assert "no value network" in value.label


def test_the_weights_are_named_in_the_card(value_file: Path) -> None:
    card = VLV(weights=value_file, device="cpu").card
    assert "vlv_model.torch" in card.weights_label
    assert len(card.weights_sha256) == 64


def save(path: Path, content: object) -> Path:
    torch.save(content, path)
    return path


def test_weights_for_other_classes_are_refused(tmp_path: Path, value_tensors: dict[str, Tensor]) -> None:
    other = value_tensors | {"top.4.weight": torch.zeros(18, 256), "top.4.bias": torch.zeros(18)}
    with pytest.raises(ModelError, match=r"other classes.*18 numbers"):
        read_value_weights(save(tmp_path / "six.torch", {"model_state_dict": other}))


def test_a_detector_s_weights_are_recognised(tmp_path: Path) -> None:
    path = save(tmp_path / "m.pth", {"roi_heads.box_predictor.cls_score.weight": torch.zeros(91, 1024)})
    with pytest.raises(ModelError, match="Mask R-CNN"):
        VLV(weights=path)


def test_the_other_model_s_weights_are_recognised() -> None:
    with pytest.raises(ModelError, match="PIRLNav"):
        VLV(weights=DATA / "pirlnav" / "ckpt.pth")


def test_a_missing_tensor_is_named(tmp_path: Path, value_tensors: dict[str, Tensor]) -> None:
    less = {name: tensor for name, tensor in value_tensors.items() if name != "top.2.bias"}
    with pytest.raises(ModelError, match=r"missing, first top\.2\.bias"):
        read_value_weights(save(tmp_path / "less.torch", {"model_state_dict": less}))


def test_a_backbone_whose_two_copies_differ_is_refused(tmp_path: Path, value_tensors: dict[str, Tensor]) -> None:
    other = value_tensors | {"features.0.weight": value_tensors["features.0.weight"] + 1}
    with pytest.raises(ModelError, match=r"features\.0\.weight differs"):
        read_value_weights(save(tmp_path / "torn.torch", {"model_state_dict": other}))


def test_numbers_that_are_not_finite_are_refused(tmp_path: Path, value_tensors: dict[str, Tensor]) -> None:
    spoilt = value_tensors | {"top.0.bias": torch.full((512,), float("nan"))}
    with pytest.raises(ModelError, match="NaN"):
        read_value_weights(save(tmp_path / "nan.torch", {"model_state_dict": spoilt}))


def test_a_tensor_with_a_name_of_one_part_is_left_out(tmp_path: Path, value_tensors: dict[str, Tensor]) -> None:
    more = value_tensors | {"features": torch.zeros(1)}
    assert "features" not in read_value_weights(save(tmp_path / "more.torch", {"model_state_dict": more})).tensors


def test_weights_that_do_not_exist_are_said_so(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="no weights at"):
        VLV(weights=tmp_path / "none.torch")


def test_a_check_says_what_is_in_the_file_and_what_stands_beside_it(value_file: Path) -> None:
    report = VLV.check(weights=value_file, device="cpu")
    assert report.facts["classes"] == "bed, chair, couch, dining table, toilet"
    assert "simulated detector" in str(report.facts["detector"])
    assert [timing.median_ms > 0 for timing in report.timings] == [True, True]


def test_a_check_without_weights_says_where_they_belong() -> None:
    with pytest.raises(ModelError, match=r"vlv_model\.torch"):
        VLV.check()
