"""The recorded fixture of the original network, made checkpoints, and a cache that is not the user's."""

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import torch

DATA = Path(__file__).parents[2] / "data" / "pirlnav"


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    """Small networks on a busy machine: threads would wait for each other."""
    torch.set_num_threads(1)


@pytest.fixture(autouse=True)
def own_directories(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exported graphs are kept for the session, weights are looked for in an empty place."""
    base = tmp_path_factory.getbasetemp()
    monkeypatch.setenv("XDG_CACHE_HOME", str(base / "cache"))
    monkeypatch.setenv("VSNBENCH_WEIGHTS", str(base / "no-weights"))


@dataclass(frozen=True)
class Recording:
    """What the original network was told and answered at 20 steps over two episodes."""

    frames: npt.NDArray[np.uint8]
    gps_m: npt.NDArray[np.float32]
    compass_rad: npt.NDArray[np.float32]
    goals: npt.NDArray[np.int64]
    begins: npt.NDArray[np.bool_]
    logits: npt.NDArray[np.float32]
    values: npt.NDArray[np.float64]
    actions: npt.NDArray[np.int64]


@pytest.fixture(scope="session")
def recording() -> Recording:
    spec = importlib.util.spec_from_file_location("images", DATA / "images.py")
    assert spec is not None
    assert spec.loader is not None
    images = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(images)
    expected = np.load(DATA / "expected.npz")
    return Recording(
        frames=images.frames(),
        gps_m=expected["gps"],
        compass_rad=expected["compass"][:, 0],
        goals=expected["objectgoal"][:, 0],
        begins=~expected["masks"][:, 0],
        logits=expected["raw_logits"],
        values=expected["value"],
        actions=expected["action"],
    )


@pytest.fixture(scope="session")
def small_checkpoint() -> Path:
    return DATA / "ckpt.pth"
