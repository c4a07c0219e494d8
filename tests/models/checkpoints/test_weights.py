"""Weights are found by path, in the directory of weights, or embedded, in this order."""

from pathlib import Path

import pytest

from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.weights import embedded_weights, find_weights

LARGEST_BYTES = 10_000_000


@pytest.fixture(autouse=True)
def directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VSNBENCH_WEIGHTS", str(tmp_path))
    return tmp_path


def test_embedded_weights_stand_in_where_there_are_no_others(directory: Path) -> None:
    embedded = embedded_weights("pirlnav.ckpt")
    assert embedded is not None
    assert embedded.stat().st_size <= LARGEST_BYTES
    assert find_weights("pirlnav", "pirlnav.ckpt", None) == embedded
    (directory / "pirlnav.ckpt").touch()
    assert find_weights("pirlnav", "pirlnav.ckpt", None) == directory / "pirlnav.ckpt"
    assert find_weights("pirlnav", "pirlnav.ckpt", Path("embedded")) == embedded


def test_a_model_without_embedded_weights_says_every_way_to_name_some(directory: Path) -> None:
    with pytest.raises(ModelError, match="vlv has no embedded weights"):
        find_weights("vlv", "vlv_model.torch", Path("embedded"))
    with pytest.raises(ModelError) as raised:
        find_weights("mylab", "mylab.ckpt", None)
    line = str(raised.value)
    assert "\n" not in line
    for way in ("--weights", "$VSNBENCH_WEIGHTS/mylab.ckpt", "vsnbench models fetch mylab", str(directory)):
        assert way in line
