"""Makes checkpoints of the released layout, with made-up weights, and files that only look like them."""

import contextlib
import pickle
import sys
import types
import zipfile
from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import torch

from vsnbench.models.pirlnav.architecture import Architecture
from vsnbench.models.pirlnav.weight_shapes import expected_shapes

SMALL = Architecture(base_planes=2, visual_size=8, hidden_size=8)


class Config(OrderedDict[str, Any]):
    """Stands for the class of the authors' configuration, which is not installed here."""


def configuration(architecture: Architecture, config: type[OrderedDict[str, Any]] = Config) -> OrderedDict[str, Any]:
    """Return the authors' configuration, as far as the network's sizes go."""
    policy = config(
        RGB_ENCODER=config(
            image_size=architecture.image_size_px,
            backbone=architecture.backbone,
            resnet_baseplanes=architecture.base_planes,
            hidden_size=architecture.visual_size,
            avgpooled_image=False,
            normalize_visual_inputs=False,
        ),
        STATE_ENCODER=config(
            hidden_size=architecture.hidden_size,
            rnn_type="GRU",
            num_recurrent_layers=architecture.recurrent_layers,
        ),
        SEQ2SEQ=config(use_prev_action=True),
    )
    return config(TRAINER_NAME="pirlnav-ppo" if architecture.critic else "pirlnav-il", POLICY=policy)


def weights(architecture: Architecture, seed: int = 3) -> dict[str, torch.Tensor]:
    """Return random weights of the right shapes, tame enough for finite answers."""
    random = torch.Generator().manual_seed(seed)
    made = {}
    for name, shape in expected_shapes(architecture).items():
        if "_var" in name:
            made[name] = torch.full(shape, 0.05)
        else:
            made[name] = torch.randn(shape, generator=random) * 0.05
            if name.endswith("bn3.weight") or (".bn" in name and name.endswith("weight")):
                made[name] += 1
    return made


@contextlib.contextmanager
def config_class_importable(module: str = "habitat.config.default", name: str = "Config") -> Iterator[None]:
    """Let pickle find `Config` under the name it has in the authors' files, while a file is written."""
    parts = module.split(".")
    names = [".".join(parts[: i + 1]) for i in range(len(parts))]
    fakes = {each: types.ModuleType(each) for each in names}
    vars(fakes[module])[name] = Config
    before = Config.__module__, Config.__qualname__, Config.__name__
    Config.__module__, Config.__qualname__, Config.__name__ = module, name, name
    sys.modules.update(fakes)
    try:
        yield
    finally:
        Config.__module__, Config.__qualname__, Config.__name__ = before
        for each in names:
            del sys.modules[each]


def write_checkpoint(
    path: Path,
    architecture: Architecture = SMALL,
    *,
    prefix: str = "actor_critic.",
    step: int = 12_000_000,
    state: dict[str, Any] | None = None,
    config: OrderedDict[str, Any] | None = None,
    config_module: str = "habitat.config.default",
    config_name: str = "Config",
) -> Path:
    """Write a checkpoint of the released layout."""
    state = weights(architecture) if state is None else state
    with config_class_importable(config_module, config_name):
        torch.save(
            {
                "state_dict": OrderedDict((prefix + name, weight) for name, weight in state.items()),
                "config": configuration(architecture) if config is None else config,
                "extra_state": {"step": step},
            },
            path,
        )
    return path


class _Storage:
    """Written as a reference to a record of tensor data, of any declared size."""

    def __init__(self, elements: int) -> None:
        self.identity = ("storage", torch.FloatStorage, "0", "cpu", elements)


class _Tensor:
    def __init__(self, elements: int, shape: tuple[int, ...], stride: tuple[int, ...]) -> None:
        self.arguments = (_Storage(elements), 0, shape, stride, False, OrderedDict())

    def __reduce__(self) -> tuple[Any, ...]:
        return torch._utils._rebuild_tensor_v2, self.arguments


class _Pickler(pickle.Pickler):
    def persistent_id(self, obj: Any) -> Any:
        return obj.identity if isinstance(obj, _Storage) else None


def write_forged(path: Path, elements: int, shape: tuple[int, ...], stride: tuple[int, ...], stored: int = 4) -> Path:
    """Write a checkpoint whose one tensor declares what it does not have; `stored` bytes are really there."""
    with zipfile.ZipFile(path, "w") as archive:
        with archive.open("ckpt/data.pkl", "w") as file:
            _Pickler(file, protocol=2).dump({"state_dict": {"w": _Tensor(elements, shape, stride)}})
        archive.writestr("ckpt/version", b"3\n")
        archive.writestr("ckpt/data/0", bytes(stored))
    return path


def write_archive(path: Path, pickled: bytes, compression: int = zipfile.ZIP_STORED) -> Path:
    """Write an archive around a hand-made pickle."""
    with zipfile.ZipFile(path, "w", compression) as archive:
        archive.writestr("ckpt/data.pkl", pickled)
        archive.writestr("ckpt/version", b"3\n")
    return path
