"""Stand-in weights of the released layouts, and a directory of weights that is not the user's."""

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import numpy as np
import numpy.typing as npt
import pytest
import torch
from torch import Tensor

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture(autouse=True)
def own_directories(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VSNBENCH_WEIGHTS", str(tmp_path_factory.getbasetemp() / "no-weights"))


def load_module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def released_tensors() -> dict[str, Tensor]:
    """Return every tensor of the released file, drawn by recipe; the backbone stored twice, as there."""
    shapes = {name: tuple(shape) for name, shape in json.loads((DATA / "vlv" / "shapes.json").read_text()).items()}
    drawn = load_module(DATA / "vlv" / "weights.py").state_dict(shapes)
    twins = {"0": "conv1", "1": "bn1", "4": "layer1", "5": "layer2", "6": "layer3", "7": "layer4"}
    for name in drawn:
        parts = name.split(".")
        if parts[0] == "features" and parts[1] in twins:
            drawn[name] = drawn[".".join(["resnet", twins[parts[1]], *parts[2:]])]
    return {name: torch.from_numpy(np.asarray(array)) for name, array in drawn.items()}


def write_value_network(path: Path, tensors: dict[str, Tensor]) -> Path:
    """Write a file of the released layout."""
    torch.save({"model_state_dict": tensors, "epoch": 3}, path)
    return path


@pytest.fixture(scope="session")
def value_tensors() -> dict[str, Tensor]:
    return released_tensors()


@pytest.fixture(scope="session")
def value_file(tmp_path_factory: pytest.TempPathFactory, value_tensors: dict[str, Tensor]) -> Path:
    return write_value_network(tmp_path_factory.mktemp("weights") / "vlv_model.torch", value_tensors)


@pytest.fixture(scope="session")
def frames() -> npt.NDArray[np.uint8]:
    """Input images of the original network."""
    made: npt.NDArray[np.uint8] = load_module(DATA / "pirlnav" / "images.py").frames(6, 224, 224, seed=31)
    return made
