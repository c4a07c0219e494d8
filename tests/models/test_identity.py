"""Identity of a user's model: content of its files and code; built-in models declare theirs."""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from vsnbench.models.baselines.random_walk import RandomWalk
from vsnbench.models.contract import Policy
from vsnbench.models.identity import code_of, files_handed_over
from vsnbench.models.registry import create_policy

LAB = "ourlab.policy:Lab"
SOURCE = """
from {net} import TURNS
from vsnbench.models.contract import ModelCard, Policy

class Lab(Policy):
    def __init__(self, weights=None, model_config=None):
        self.card = ModelCard("lab")
    def reset(self, goal, seed): ...
    def act(self, observation): ...
"""


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    package = tmp_path / "ourlab"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "net.py").write_text("TURNS = 12\n")
    (package / "unused.py").write_text("")
    (package / "policy.py").write_text(SOURCE.format(net="ourlab.net"))
    (tmp_path / "lonely.py").write_text(SOURCE.format(net="lonely_net"))
    (tmp_path / "lonely_net.py").write_text("TURNS = 12\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    forget()


def forget() -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] in ("ourlab", "lonely", "lonely_net")]:
        del sys.modules[name]
    importlib.invalidate_caches()


def made(where: str, **options: Path) -> Policy:
    forget()
    return create_policy(where, **options)


@pytest.mark.parametrize(
    ("where", "part", "elsewhere"),
    [
        ("ourlab.policy:Lab", "ourlab/net.py", "ourlab/unused.py"),
        ("lonely:Lab", "lonely_net.py", "unrelated.py"),
    ],
)
def test_another_line_in_the_code_that_made_it_is_another_model(
    lab: Path, where: str, part: str, elsewhere: str
) -> None:
    first = code_of(made(where))
    assert first["class"] == where
    assert "commit" not in first
    assert code_of(made(where)) == first
    (lab / elsewhere).write_text("a = 1\n")
    assert code_of(made(where)) == first, "code that is not loaded makes no difference"
    (lab / part).write_text("TURNS = 130\n")
    assert code_of(made(where))["sha256"] != first["sha256"]


def test_files_are_told_apart_by_content_not_by_name(lab: Path) -> None:
    one, two, other = lab / "a.pt", lab / "b.pt", lab / "c.pt"
    one.write_bytes(b"weights")
    two.write_bytes(b"weights")
    other.write_bytes(b"others")
    policy = made(LAB, weights=one)
    assert set(files_handed_over(LAB, policy, {"weights": one, "device": "cpu"})) == {"weights"}
    assert files_handed_over(LAB, policy, {"weights": one}) == files_handed_over(LAB, policy, {"weights": two})
    assert files_handed_over(LAB, policy, {"weights": one}) != files_handed_over(LAB, policy, {"weights": other})
    assert set(files_handed_over(LAB, policy, {"weights": one, "model_config": other})) == {"weights", "model_config"}


def test_a_directory_of_weights_is_hashed_whole(lab: Path) -> None:
    directory = lab / "weights" / "shards"
    directory.mkdir(parents=True)
    (directory / "1.bin").write_bytes(b"a")
    policy = made(LAB)
    first = files_handed_over(LAB, policy, {"weights": directory.parent})
    (directory / "2.bin").write_bytes(b"")
    assert files_handed_over(LAB, policy, {"weights": directory.parent}) != first


def test_what_vsnbench_brings_along_says_it_on_its_card(tmp_path: Path) -> None:
    file = tmp_path / "weights.pt"
    file.write_bytes(b"x")
    assert code_of(RandomWalk()) == {}
    assert files_handed_over("random", RandomWalk(), {"weights": file}) == {}
