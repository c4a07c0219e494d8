"""Checkpoints of the released layout are read whole, with either prefix and with or without a critic."""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch

from tests.models.pirlnav.checkpoints import SMALL, weights, write_checkpoint
from vsnbench.errors import ModelError
from vsnbench.models.pirlnav.architecture import Architecture
from vsnbench.models.pirlnav.checkpoint import read_checkpoint, read_published
from vsnbench.models.pirlnav.network import PIRLNavNetwork
from vsnbench.models.pirlnav.policy import PIRLNav
from vsnbench.models.pirlnav.settings import PIRLNavSettings
from vsnbench.models.pirlnav.weight_shapes import expected_shapes
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

CAMERA = Camera(width=640, height=480, horizontal_fov_deg=79, mount_height_m=0.88)


def test_the_fixture_says_what_it_is(small_checkpoint: Path) -> None:
    checkpoint = read_checkpoint(small_checkpoint)
    assert checkpoint.architecture == Architecture(base_planes=8, visual_size=32, hidden_size=64)
    assert checkpoint.training_step == 260_000_000
    assert checkpoint.trainer == "pirlnav-ppo"
    assert checkpoint.prefix == "actor_critic."
    assert checkpoint.sha256 == "df429dd5ffb1d535a3f77a159c506c617eff3a596b7f620589d9393d5f66c03d"


@pytest.mark.parametrize("critic", [True, False], ids=["critic", "no critic"])
@pytest.mark.parametrize("prefix", ["actor_critic.", "model."])
def test_prefixes_and_critics(tmp_path: Path, prefix: str, critic: bool) -> None:
    sizes = SMALL.model_copy(update={"critic": critic})
    checkpoint = read_checkpoint(write_checkpoint(tmp_path / "made.ckpt", sizes, prefix=prefix))
    assert checkpoint.architecture == sizes
    assert checkpoint.prefix == prefix
    assert len(checkpoint.weights) == (185 if critic else 183)
    for name, weight in weights(sizes).items():
        np.testing.assert_array_equal(checkpoint.weights[name], weight.numpy())


def test_the_other_class_of_configuration_is_read_too(tmp_path: Path) -> None:
    path = write_checkpoint(tmp_path / "yacs.ckpt", config_module="yacs.config", config_name="CfgNode")
    assert read_checkpoint(path).architecture == SMALL


def test_a_configuration_of_another_class_is_refused(tmp_path: Path) -> None:
    path = write_checkpoint(tmp_path / "other.ckpt", config_module="omegaconf.dictconfig", config_name="DictConfig")
    with pytest.raises(ModelError, match=r"omegaconf\.dictconfig\.DictConfig"):
        read_checkpoint(path)


def test_half_precision_weights_are_widened(tmp_path: Path) -> None:
    halves = {name: weight.half() for name, weight in weights(SMALL).items()}
    checkpoint = read_checkpoint(write_checkpoint(tmp_path / "half.ckpt", state=halves))
    assert {weight.dtype for weight in checkpoint.weights.values()} == {np.dtype(np.float32)}


def test_a_frame_count_beyond_half_precision_does_not_make_a_checkpoint_damaged(tmp_path: Path) -> None:
    state = weights(SMALL)
    state["net.visual_encoder.running_mean_and_var._count"] = torch.tensor(2.6e8)
    halves = {name: weight.half() for name, weight in state.items()}
    assert torch.isinf(halves["net.visual_encoder.running_mean_and_var._count"])
    checkpoint = read_checkpoint(write_checkpoint(tmp_path / "half.ckpt", state=halves))
    for name, weight in checkpoint.weights.items():
        if not name.endswith("_count"):
            np.testing.assert_array_equal(weight, halves[name].float().numpy())
    halves["net.visual_encoder.running_mean_and_var._var"][0, 0] = float("inf")
    with pytest.raises(ModelError, match="_var contains NaN or infinite numbers"):
        read_checkpoint(write_checkpoint(tmp_path / "damaged.ckpt", state=halves))


def test_the_released_sizes_have_the_released_number_of_parameters() -> None:
    def count(sizes: Architecture) -> int:
        shapes = expected_shapes(sizes)
        return sum(int(np.prod(shape)) for name, shape in shapes.items() if "running_mean_and_var" not in name)

    assert len(expected_shapes(Architecture())) == 185
    assert count(Architecture()) == 48_957_127
    assert count(Architecture(critic=False)) == 48_957_127 - 2049


@pytest.fixture
def full_checkpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A checkpoint of the released size; it and its exported graph do not stay behind, being 400 MB."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    yield write_checkpoint(tmp_path / "full.ckpt", Architecture(), step=301_989_888)
    shutil.rmtree(tmp_path)


def test_a_full_size_checkpoint_runs_on_camera_images(full_checkpoint: Path) -> None:
    path = full_checkpoint
    assert read_published(path, fine_tuned=True).training_step == 301_989_888
    with pytest.raises(ModelError, match="the published checkpoint after RL, not the one before RL"):
        read_published(path, fine_tuned=False)
    assert path.stat().st_size == pytest.approx(196e6, rel=0.01)
    policy = PIRLNav(path, PIRLNavSettings(runtime="onnxruntime"), device="cpu")
    assert policy.chosen.agreement is not None
    assert policy.chosen.agreement.largest_difference < 1e-4
    assert policy.card.weights_label == "full.ckpt, RL fine-tuned, 301.99 M steps"
    rgb = np.random.default_rng(1).integers(0, 256, (480, 640, 3), np.uint8)
    policy.reset("bed", seed=3)
    for step in range(2):
        decision = policy.act(Observation(rgb, None, Pose(0.25 * step, 0.0), float(step), CAMERA))
        assert sum(decision.diagnostics.probabilities.values()) == pytest.approx(1)


@pytest.mark.parametrize("sizes", [SMALL, Architecture(critic=False, recurrent_layers=1, goals=4, actions=3)])
def test_expected_shapes_are_those_of_the_network_in_its_order(sizes: Architecture) -> None:
    with torch.device("meta"):
        state = PIRLNavNetwork(sizes).state_dict()
    assert list(expected_shapes(sizes).items()) == [(name, tuple(weight.shape)) for name, weight in state.items()]


def test_a_network_is_built_without_loading_pytorch_s_compiler() -> None:
    """It takes 2.5 s of the processor, in every process and worker that loads the model."""
    program = """
import sys
import numpy as np
from vsnbench.models.pirlnav.architecture import Architecture
from vsnbench.models.pirlnav.network import build_network
from vsnbench.models.pirlnav.weight_shapes import expected_shapes
sizes = Architecture(base_planes=2, visual_size=8, hidden_size=8)
build_network(sizes, {name: np.zeros(shape, np.float32) for name, shape in expected_shapes(sizes).items()})
assert "torch._dynamo" not in sys.modules
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
