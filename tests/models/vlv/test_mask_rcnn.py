"""Mask R-CNN with stand-in weights gives torchvision's recorded results.

`mask_rcnn.npz` holds what torchvision 0.29.2 (ResNet-50, feature pyramid, 91 classes, normalisation without epsilon)
found with the stand-in weights below; its compiled operators were replaced by their definitions in plain PyTorch.
"""

import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from tests.models.vlv.conftest import DATA, load_module
from vsnbench.errors import ModelError
from vsnbench.models.vlv.detectors.coco import CLASSES_80, CLASSES_91
from vsnbench.models.vlv.detectors.mask_rcnn import MaskRCNNDetector, read_mask_rcnn_weights
from vsnbench.models.vlv.detectors.mask_rcnn_network import MaskRCNN
from vsnbench.models.vlv.policy import VLV
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

CAMERA = Camera(width=640, height=480, horizontal_fov_deg=60, mount_height_m=0.6)


def stand_in_tensor(name: str, shape: tuple[int, ...]) -> Tensor:
    draw = np.random.default_rng(zlib.crc32(name.encode())).standard_normal(shape).astype(np.float32)
    if name.endswith("running_var"):
        draw = 1 + 0.1 * np.abs(draw)
    elif name.endswith(("running_mean", "bias")):
        draw = 0.05 * draw
    elif len(shape) == 1:
        draw = (1 + 0.1 * draw) * (0.25 if "bn3" in name else 1)
    elif "cls_score" in name:
        draw = 0.04 * draw
    elif "bbox_pred" in name or "cls_logits" in name:
        draw = 0.01 * draw
    else:
        draw = draw * np.sqrt((1 if "backbone" in name else 2) / np.prod(shape[1:]))
    return torch.from_numpy(np.asarray(draw, np.float32))


@pytest.fixture(scope="module")
def stand_in() -> dict[str, Tensor]:
    with torch.device("meta"):
        shapes = {name: tuple(tensor.shape) for name, tensor in MaskRCNN(91).state_dict().items()}
    return {name: stand_in_tensor(name, shape) for name, shape in shapes.items()}


def released_name(name: str) -> str:
    """Return the name that a tensor has in torchvision's released file, older than its code."""
    name = name.replace("rpn.head.conv.0.0.", "rpn.head.conv.")
    if name.startswith("backbone.fpn."):
        name = name.replace(".0.weight", ".weight").replace(".0.bias", ".bias")
    if name.startswith("roi_heads.mask_head."):
        number, _, kind = name.removeprefix("roi_heads.mask_head.").split(".")
        name = f"roi_heads.mask_head.mask_fcn{int(number) + 1}.{kind}"
    return name


@pytest.fixture(scope="module")
def released_file(stand_in: Mapping[str, Tensor], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("detector") / "maskrcnn_resnet50_fpn_coco.pth"
    torch.save({released_name(name): tensor for name, tensor in stand_in.items()}, path)
    return path


def test_finds_on_a_camera_image_what_torchvision_finds(released_file: Path) -> None:
    expected = np.load(DATA / "vlv" / "mask_rcnn.npz")
    image = load_module(DATA / "pirlnav" / "images.py").frames(2)[1]
    observation = Observation(image, None, Pose(0, 0), 0.0, CAMERA)
    detector = MaskRCNNDetector(released_file, "cpu", threshold=0.06)
    found = detector.run(observation)
    assert len(found.scores) == len(expected["scores"]) > 10
    assert np.array_equal(found.labels.numpy(), expected["labels"])
    np.testing.assert_allclose(found.boxes.numpy(), expected["boxes"], atol=0.02)
    np.testing.assert_allclose(found.scores.numpy(), expected["scores"], atol=1e-5)
    over = int((expected["scores"] >= 0.06).sum())
    detections = detector.detections(found, (480, 640))
    assert [each.label for each in detections] == [CLASSES_91[k] for k in expected["labels"][:over]]
    theirs = np.unpackbits(expected["masks"]).astype(bool).reshape(5, 480, 640)
    for detection, mask in zip(detections[:5], theirs, strict=True):
        differing = np.count_nonzero(detection.mask ^ mask)
        assert differing <= max(4, 0.05 * np.count_nonzero(mask))


def test_knows_the_goals_by_coco_s_names(released_file: Path) -> None:
    vlv = VLV(model_config=VLVSettings(detector_weights=str(released_file)), device="cpu")
    assert vlv.card.goals == {"chair", "sofa", "table", "bed", "toilet"}
    assert "Mask R-CNN" in vlv.card.weights_label
    assert "instances" not in {sensor.value for sensor in vlv.card.sensors}
    assert len(CLASSES_80) == 80


def test_reads_the_names_of_later_versions_too(stand_in: Mapping[str, Tensor], tmp_path: Path) -> None:
    torch.save({"model": dict(stand_in)}, tmp_path / "trained.pth")
    assert read_mask_rcnn_weights(tmp_path / "trained.pth").keys() == stand_in.keys()


def test_refuses_weights_for_other_classes(stand_in: Mapping[str, Tensor], tmp_path: Path) -> None:
    other = dict(stand_in) | {"roi_heads.box_predictor.cls_score.weight": torch.zeros(21, 1024)}
    torch.save(other, tmp_path / "voc.pth")
    with pytest.raises(ModelError, match="trained for 21 classes"):
        read_mask_rcnn_weights(tmp_path / "voc.pth")


def test_refuses_numbers_that_float32_does_not_have(stand_in: Mapping[str, Tensor], tmp_path: Path) -> None:
    name = "roi_heads.box_predictor.cls_score.bias"
    torch.save(dict(stand_in) | {name: torch.full((91,), 1e300, dtype=torch.float64)}, tmp_path / "large.pth")
    with pytest.raises(ModelError, match=f"{name} contains NaN or infinite numbers"):
        read_mask_rcnn_weights(tmp_path / "large.pth")


def test_refuses_the_value_network_in_its_place(value_file: Path) -> None:
    with pytest.raises(ModelError, match="VLV's value network, not a detector"):
        VLV(model_config=VLVSettings(detector_weights=str(value_file)))


def test_refuses_another_network(tmp_path: Path) -> None:
    torch.save({"fc.weight": torch.zeros(3, 3)}, tmp_path / "other.pth")
    with pytest.raises(ModelError, match="not the weights of a Mask R-CNN"):
        VLV(model_config=VLVSettings(detector_weights=str(tmp_path / "other.pth")))
