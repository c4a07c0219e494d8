"""`vsnbench run --model pirlnav` in the apartment, recorded with probabilities and raw actions."""

import contextlib
import json
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from tests.cli.console import Answer, vsnbench
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.sites.site import Site
from vsnbench.values.robot_identity import RobotIdentity

Run = Callable[..., Answer]

CHECKPOINT = Path(__file__).parents[2] / "data" / "pirlnav" / "ckpt.pth"
NETWORK_ACTIONS = ["STOP", "MOVE_FORWARD", "TURN_LEFT", "TURN_RIGHT", "LOOK_UP", "LOOK_DOWN"]
DRIVEN_AS = {"LOOK_UP": "MOVE_BACKWARD", "LOOK_DOWN": "MOVE_FORWARD"}


@pytest.fixture
def run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path_factory: pytest.TempPathFactory
) -> Run:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "cache"))
    torch.set_num_threads(1)
    return lambda *words: vsnbench(monkeypatch, capsys, *words)


@pytest.fixture(autouse=True)
def _on_the_cpu(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "vsnbench.toml").write_text('[models]\ndevice = "cpu"\n')
    monkeypatch.chdir(tmp_path)


def test_steps_keep_probabilities_and_the_networks_own_action(run: Run, tmp_path: Path) -> None:
    settings = tmp_path / "pirlnav.yaml"
    settings.write_text("decision: sampled\n")
    results = tmp_path / "results"
    answer = run(
        *("run", "--model", "pirlnav", "--weights", str(CHECKPOINT), "--model-config", str(settings)),
        *("--goal", "chair", "--starts", "1-2", "--max-steps", "8", "--results", str(results)),
    )
    assert answer.code == 0, answer.err
    with contextlib.closing(sqlite3.connect(results / "vsnbench.db")) as database:
        (model,) = database.execute("select name, weights_sha256, weights_label, settings from model").fetchall()
        steps = database.execute("select raw_action, action, probabilities, details from step").fetchall()
        (episodes,) = database.execute("select count(*) from verdict").fetchone()
    assert episodes == 2
    assert model[:3] == (
        "pirlnav",
        "df429dd5ffb1d535a3f77a159c506c617eff3a596b7f620589d9393d5f66c03d",
        "ckpt.pth, RL fine-tuned, 260 M steps",
    )
    assert json.loads(model[3])["decision"] == "sampled"
    for raw_action, action, probabilities, details in steps:
        assert action == DRIVEN_AS.get(raw_action, raw_action)
        assert list(json.loads(probabilities)) == NETWORK_ACTIONS
        assert sum(json.loads(probabilities).values()) == pytest.approx(1)
        assert len(json.loads(details)["logits"]) == 6
    assert any(raw_action != action for raw_action, action, _, _ in steps), "the network sometimes looks up or down"

    shown = run("episodes", "show", "1", "--results", str(results))
    assert shown.code == 0, shown.err
    assert "ckpt.pth, RL fine-tuned, 260 M steps" in shown.out
    assert "decision=sampled" in shown.out


@pytest.mark.parametrize(
    ("goal", "weights", "code", "says"),
    [
        ("table", str(CHECKPOINT), 2, "pirlnav does not know table; it knows bed, chair, monitor, plant, sofa, toilet"),
        ("chair", "/nowhere.ckpt", 1, "no weights at /nowhere.ckpt"),
        ("chair", __file__, 1, "not a PyTorch checkpoint"),
    ],
)
def test_what_it_cannot_do_is_said_before_anything_moves(
    run: Run, tmp_path: Path, goal: str, weights: str, code: int, says: str
) -> None:
    results = tmp_path / "results"
    options = ("--weights", weights, "--goal", goal, "--starts", "1", "--results", str(results))
    answer = run("run", "--model", "pirlnav", *options)
    assert answer.code == code
    assert says in answer.err
    assert answer.out == ""
    assert answer.err.count("\n") == 1
    assert not results.exists()


class SimulatedAsReal(SimulatedRobot):
    """Minimal stand-in for a real robot."""

    def __init__(self, site: Site, parameters: ProtocolParameters) -> None:
        super().__init__(site, load_profile("turtlebot2"), parameters)

    @property
    def identity(self) -> RobotIdentity:
        return replace(super().identity, simulated=False)


def test_a_real_robot_is_not_driven_by_weights_that_nobody_named(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VSNBENCH_WEIGHTS", str(tmp_path / "none"))
    results = tmp_path / "results"
    words = ("run", "--model", "pirlnav", "--goal", "chair", "--starts", "1", "--max-steps", "2")
    robot = ("--robot", f"{__name__}:SimulatedAsReal", "--results", str(results))
    refused = run(*words, *robot)
    assert refused.code == 2
    assert "is real" in refused.err
    assert "embedded demonstration weights" in refused.err
    assert "--weights embedded" in refused.err
    assert not results.exists()
    by_name = run(*words, *robot, "--weights", "embedded")
    assert by_name.code == 0, by_name.err


def test_in_simulation_the_embedded_weights_run_and_are_called_that_everywhere(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("VSNBENCH_WEIGHTS", str(tmp_path / "none"))
    results = ("--results", str(tmp_path / "results"))
    label = "embedded demonstration weights"
    ran = run("run", "--model", "pirlnav", "--goal", "chair", "--starts", "1", "--max-steps", "2", *results)
    assert ran.code == 0, ran.err
    assert label in caplog.text
    for words in (("report", "--format", "markdown"), ("episodes", "show", "1")):
        assert label in " ".join(run(*words, *results).out.split())
