"""The policy around the network: goals, actions, memory, chance, settings, and what goes into the record."""

import json
import logging
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.models.pirlnav.checkpoints import SMALL, write_checkpoint
from tests.models.pirlnav.conftest import Recording
from vsnbench.errors import ModelError, UsageError
from vsnbench.models.contract import Policy
from vsnbench.models.pirlnav import acceleration, onnx_engine
from vsnbench.models.pirlnav.architecture import Architecture
from vsnbench.models.pirlnav.checkpoint import Checkpoint, read_checkpoint
from vsnbench.models.pirlnav.engine import Engine, StepInput, StepOutput
from vsnbench.models.pirlnav.onnx_graph import Weights, network_file
from vsnbench.models.pirlnav.policy import ACTIONS, PIRLNav
from vsnbench.models.pirlnav.settings import PIRLNavSettings
from vsnbench.models.registry import create_policy
from vsnbench.values.camera import Camera
from vsnbench.values.decision import Decision
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose

CAMERA = Camera(width=640, height=480, horizontal_fov_deg=79, mount_height_m=0.88)
EAGER = PIRLNavSettings(runtime="torch")
EXPORTED = PIRLNavSettings(runtime="onnxruntime")


def look(recording: Recording, step: int, pose: Pose | None = None) -> Observation:
    return Observation(recording.frames[step], None, pose or Pose(0.0, 0.0), float(step), CAMERA)


def episode(policy: PIRLNav, recording: Recording, seed: int, steps: int = 12, goal: str = "chair") -> list[Decision]:
    policy.reset(goal, seed)
    return [policy.act(look(recording, step)) for step in range(steps)]


class Scripted(Engine):
    """Answers with fixed preferences and remembers what it was told."""

    label = "scripted"

    def __init__(self, *chosen: int) -> None:
        self.chosen = list(chosen)
        self.told: list[StepInput] = []

    def step(self, step: StepInput) -> StepOutput:
        logits = np.full(6, -20.0, np.float32)
        logits[self.chosen[len(self.told)]] = 20.0
        self.told.append(step)
        return StepOutput(logits, float("nan"))


@pytest.fixture
def policy(small_checkpoint: Path) -> PIRLNav:
    return PIRLNav(small_checkpoint, EAGER, "cpu")


def scripted(policy: PIRLNav, monkeypatch: pytest.MonkeyPatch, *chosen: int) -> Scripted:
    engine = Scripted(*chosen)
    chosen_engine = policy.chosen
    monkeypatch.setattr(
        policy,
        "chosen",
        acceleration.ChosenEngine(engine, chosen_engine.runtime, "cpu", chosen_engine.precision, 1, None),
    )
    return engine


def test_looking_up_drives_back_and_looking_down_drives_on_with_the_models_word_kept(
    policy: PIRLNav, monkeypatch: pytest.MonkeyPatch, recording: Recording
) -> None:
    scripted(policy, monkeypatch, *range(6))
    decisions = episode(policy, recording, seed=0, steps=6)
    assert [(d.raw_action, d.action) for d in decisions] == [
        ("STOP", Action.STOP),
        ("MOVE_FORWARD", Action.MOVE_FORWARD),
        ("TURN_LEFT", Action.TURN_LEFT),
        ("TURN_RIGHT", Action.TURN_RIGHT),
        ("LOOK_UP", Action.MOVE_BACKWARD),
        ("LOOK_DOWN", Action.MOVE_FORWARD),
    ]


def test_after_a_blocked_move_the_network_is_told_what_it_chose(
    policy: PIRLNav, monkeypatch: pytest.MonkeyPatch, recording: Recording
) -> None:
    engine = scripted(policy, monkeypatch, 1, 5, 2)
    policy.reset("sofa", seed=0)
    for step in range(3):  # the robot never moves: every forward was refused
        policy.act(look(recording, step, Pose(0.0, 0.0)))
    assert [step.previous_index for step in engine.told] == [0, 2, 6]
    assert [step.begins for step in engine.told] == [True, False, False]
    assert {step.goal for step in engine.told} == {5}


def test_every_goal_has_its_hm3d_number(policy: PIRLNav, monkeypatch: pytest.MonkeyPatch, recording: Recording) -> None:
    engine = scripted(policy, monkeypatch, *[1] * 6)
    for goal in ("chair", "bed", "plant", "toilet", "monitor", "sofa"):
        policy.reset(goal, seed=0)
        policy.act(look(recording, 0))
    assert [step.goal for step in engine.told] == [0, 1, 2, 3, 4, 5]
    assert all(step.begins for step in engine.told)


def test_the_robots_odometry_reaches_the_network_as_forward_and_right(
    policy: PIRLNav, monkeypatch: pytest.MonkeyPatch, recording: Recording
) -> None:
    engine = scripted(policy, monkeypatch, 1)
    policy.reset("chair", seed=0)
    decision = policy.act(look(recording, 0, Pose.from_degrees(1.5, -0.5, 60)))
    assert engine.told[0].gps_m == (1.5, 0.5)
    assert engine.told[0].compass_rad == pytest.approx(np.pi / 3)
    assert decision.diagnostics.scalars["compass_rad"] == pytest.approx(np.pi / 3)
    assert "value" not in decision.diagnostics.scalars


def test_a_goal_it_does_not_know_is_refused_with_those_it_knows(policy: PIRLNav) -> None:
    assert policy.card.goals == frozenset({"chair", "bed", "plant", "toilet", "monitor", "sofa"})
    with pytest.raises(UsageError, match=r"'table'.*chair.*monitor.*sofa"):
        policy.reset("table", seed=0)


def test_acting_before_an_episode_begins_is_an_error(policy: PIRLNav, recording: Recording) -> None:
    with pytest.raises(ModelError, match="reset"):
        policy.act(look(recording, 0))


def test_sampling_follows_from_the_seed_and_nothing_else(small_checkpoint: Path, recording: Recording) -> None:
    policy = PIRLNav(small_checkpoint, PIRLNavSettings(decision="sampled", runtime="torch"), "cpu")
    first = [decision.raw_action for decision in episode(policy, recording, seed=4)]
    other = [decision.raw_action for decision in episode(policy, recording, seed=5)]
    again = [decision.raw_action for decision in episode(policy, recording, seed=4)]
    assert first == again
    assert first != other


def test_samples_come_as_often_as_their_probabilities_say(policy: PIRLNav, recording: Recording) -> None:
    policy.reset("chair", seed=1)
    shares = np.array([0.05, 0.5, 0.2, 0.15, 0.1, 0.0])
    generator = np.random.default_rng(1)
    drawn = np.bincount([policy._choose(shares, generator) for _ in range(4000)], minlength=6) / 4000
    np.testing.assert_allclose(drawn, shares, atol=0.03)


@pytest.mark.parametrize(("critic", "decision"), [(True, "sampled"), (False, "greedy")])
def test_by_default_weights_decide_as_their_authors_evaluated_them(tmp_path: Path, critic: bool, decision: str) -> None:
    path = write_checkpoint(tmp_path / "made.ckpt", SMALL.model_copy(update={"critic": critic}))
    assert PIRLNav(path, EAGER, "cpu").card.settings["decision"] == decision


def test_the_record_can_be_written_as_json_and_names_the_weights(policy: PIRLNav, recording: Recording) -> None:
    assert isinstance(policy, Policy)
    card = policy.card
    assert card.sensors == {Sensor.RGB, Sensor.ODOMETRY}
    assert card.weights_sha256 == "df429dd5ffb1d535a3f77a159c506c617eff3a596b7f620589d9393d5f66c03d"
    assert card.weights_label == "ckpt.pth, RL fine-tuned, 260 M steps"
    assert json.loads(json.dumps(dict(card.settings)))["precision"] == "single"
    assert (card.runs_on["device"], card.runs_on["runtime"]) == ("cpu", "torch")
    assert not {"device", "runtime", "threads"} & card.settings.keys(), "where it runs does not make it another model"
    decision = episode(policy, recording, seed=0, steps=1)[0]
    assert list(decision.diagnostics.probabilities) == list(ACTIONS)
    assert json.loads(json.dumps(decision.diagnostics.details))["logits"]
    assert np.isfinite(decision.diagnostics.scalars["value"])


def test_as_published_images_are_augmented_from_the_seed(small_checkpoint: Path, recording: Recording) -> None:
    published = PIRLNav(small_checkpoint, PIRLNavSettings(as_published=True, runtime="torch"), "cpu")
    correct = PIRLNav(small_checkpoint, EAGER, "cpu")
    logits = [
        [d.diagnostics.details["logits"] for d in episode(policy, recording, seed=seed, steps=3)]
        for policy, seed in [(published, 1), (published, 1), (published, 2), (correct, 1), (correct, 2)]
    ]
    assert logits[0] == logits[1]
    assert logits[0] != logits[2]
    assert logits[3][0] == logits[4][0]
    assert published.card.settings["as_published"] is True


def test_settings_come_from_a_file_and_go_into_the_record(tmp_path: Path, small_checkpoint: Path) -> None:
    file = tmp_path / "pirlnav.yaml"
    file.write_text("decision: greedy\ncompass: turns\nruntime: torch\n")
    policy = create_policy("pirlnav", weights=small_checkpoint, model_config=file, device="cpu")
    assert policy.card.settings["decision"] == "greedy"
    assert policy.card.settings["compass"] == "turns"


@pytest.mark.parametrize(("named", "stand_in"), [(None, True), ("embedded", False)])
def test_the_embedded_weights_call_themselves_what_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, named: str | None, stand_in: bool
) -> None:
    monkeypatch.setenv("VSNBENCH_WEIGHTS", str(tmp_path))
    card = PIRLNav(named, EAGER, "cpu").card
    assert card.weights_label == (
        "embedded demonstration weights, trained in simulated apartments, not the published model"
    )
    assert card.settings["decision"] == "sampled"
    assert card.stand_in is stand_in


def test_weights_are_found_in_the_directory_of_weights(
    tmp_path: Path, small_checkpoint: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pirlnav.ckpt").write_bytes(small_checkpoint.read_bytes())
    monkeypatch.setenv("VSNBENCH_WEIGHTS", str(tmp_path))
    card = PIRLNav(model_config=EAGER, device="cpu").card
    assert card.weights_label.startswith("pirlnav.ckpt")
    assert not card.stand_in


def test_when_onnxruntime_fails_pytorch_runs_in_its_place_with_a_warning(
    small_checkpoint: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(onnx_engine, "network_file", lambda *_: b"spoilt")
    with caplog.at_level(logging.WARNING):
        assert PIRLNav(small_checkpoint, None, "cpu").chosen.runtime == "torch"
    assert "onnxruntime cannot open the network" in caplog.text


def test_without_pytorch_onnxruntime_gives_the_same_logits(
    small_checkpoint: Path, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = episode(PIRLNav(small_checkpoint, EAGER, "cpu"), recording, seed=3)
    monkeypatch.setitem(sys.modules, "torch", None)
    policy = PIRLNav(small_checkpoint)
    assert policy.card.runs_on == {"device": "cpu", "runtime": "onnxruntime", "threads": policy.chosen.threads}
    for decision, reference in zip(episode(policy, recording, seed=3), expected, strict=True):
        assert decision.raw_action == reference.raw_action
        logits = [found.diagnostics.details["logits"] for found in (decision, reference)]
        np.testing.assert_allclose(*logits, rtol=0, atol=1e-5)


def test_without_pytorch_its_runtime_and_devices_are_refused_with_how_to_install_it(
    small_checkpoint: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    for settings, device in ((EAGER, "cpu"), (None, "cuda")):
        with pytest.raises(ModelError, match=r"PyTorch.*pip install .*\[neural\]"):
            PIRLNav(small_checkpoint, settings, device)


def test_without_pytorch_a_check_times_onnxruntime_and_warns(
    small_checkpoint: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    checked = PIRLNav.check(small_checkpoint)
    assert checked.parity is None
    assert [timing.engine.split()[0] for timing in checked.timings] == ["onnxruntime"]
    assert "PyTorch" in checked.warning


@pytest.mark.parametrize(
    ("settings", "device", "error"),
    [
        (PIRLNavSettings(), "tpu", "unknown device 'tpu'"),
        (PIRLNavSettings(precision="half"), "cpu", "half needs a CUDA device"),
    ],
)
def test_what_cannot_run_is_refused(small_checkpoint: Path, settings: PIRLNavSettings, device: str, error: str) -> None:
    with pytest.raises(UsageError, match=error):
        PIRLNav(small_checkpoint, settings, device)


def test_a_device_that_is_not_there_is_refused(small_checkpoint: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import torch

    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ModelError, match="finds no cuda device"):
        PIRLNav(small_checkpoint, None, "cuda")


# Most machines have no GPU. Other tests of this file choose between engines that only claim to run on one.
@pytest.mark.skipif("not __import__('torch').cuda.is_available()", reason="needs a CUDA device")
def test_on_a_gpu_it_answers_as_on_the_cpu_and_the_same_each_time(recording: Recording, small_checkpoint: Path) -> None:
    assert PIRLNav(small_checkpoint, None, "cuda").chosen.agreement is not None, "it was refused"
    there, again, here = (
        episode(PIRLNav(small_checkpoint, None, device), recording, 3) for device in ("cuda", "cuda", "cpu")
    )
    logits = [one.diagnostics.details["logits"] for one in there]
    assert logits == [one.diagnostics.details["logits"] for one in again]
    assert [one.raw_action for one in there] == [one.raw_action for one in here]
    assert PIRLNav(small_checkpoint, None, "cuda").card.settings == PIRLNav(small_checkpoint, None, "cpu").card.settings


def test_the_engine_that_is_faster_here_runs_and_every_process_keeps_to_it(
    tmp_path: Path, small_checkpoint: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    measured = [(1.0, 2.0), (2.0, 1.0)]
    monkeypatch.setattr(acceleration, "_step_times_s", lambda *_: np.array(measured.pop(0)))
    for _ in range(2):
        assert PIRLNav(small_checkpoint, None, "cpu").card.runs_on["runtime"] == "torch"
    assert PIRLNav(small_checkpoint, None, "cpu", "onnxruntime").card.runs_on["runtime"] == "onnxruntime"
    assert len(measured) == 1
    shutil.rmtree(tmp_path / "vsnbench" / "engines")
    assert PIRLNav(small_checkpoint, None, "cpu").card.runs_on["runtime"] == "onnxruntime"


@pytest.mark.parametrize(("cpu_s", "gpu_s", "device"), [(0.004, 0.007, "cpu"), (0.060, 0.005, "mps")])
def test_auto_takes_a_gpu_that_is_faster_here_and_every_process_keeps_to_it(
    tmp_path: Path, small_checkpoint: Path, monkeypatch: pytest.MonkeyPatch, cpu_s: float, gpu_s: float, device: str
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(acceleration, "available_device", lambda wanted: "mps" if wanted == "auto" else wanted)
    made = []

    def on_gpu(gpu: str, checkpoint: Checkpoint, threads: int, *, half: bool) -> acceleration.ChosenEngine:
        assert not half
        made.append(gpu)
        return replace(acceleration._on_cpu(checkpoint, EAGER, threads), device=gpu)

    monkeypatch.setattr(acceleration, "_on_gpu", on_gpu)
    monkeypatch.setattr(acceleration, "_step_times_s", lambda *_: np.array((cpu_s, gpu_s)))
    assert PIRLNav(small_checkpoint, EAGER).card.runs_on["device"] == device
    monkeypatch.setattr(acceleration, "_step_times_s", lambda *_: pytest.fail("it was measured again"))
    made.clear()
    assert PIRLNav(small_checkpoint, EAGER).card.runs_on["device"] == device
    assert made == ([] if device == "cpu" else ["mps"]), "a GPU that is not used is not touched"
    assert PIRLNav(small_checkpoint, EXPORTED).card.runs_on["device"] == "cpu", "onnxruntime was asked for"


def test_both_engines_are_timed(small_checkpoint: Path) -> None:
    checkpoint = read_checkpoint(small_checkpoint)
    engines = [acceleration.choose_engine(checkpoint, settings, "cpu").engine for settings in (EAGER, EXPORTED)]
    times_s = acceleration._step_times_s(engines, checkpoint)
    assert times_s.shape == (2,)
    assert np.isfinite(times_s).all()
    assert (times_s > 0).all()


def test_a_network_that_gives_other_logits_is_noticed_and_not_used(
    small_checkpoint: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def spoilt(sizes: Architecture, weights: Weights) -> bytes:
        return network_file(sizes, {**weights, "action_distribution.linear.bias": np.ones(6, np.float32)})

    monkeypatch.setattr(onnx_engine, "network_file", spoilt)
    with caplog.at_level(logging.WARNING):
        policy = PIRLNav(small_checkpoint, None, "cpu")
    assert "disagrees with PyTorch" in caplog.text
    assert policy.card.runs_on["runtime"] == "torch"


def test_steps_keep_no_history(policy: PIRLNav, recording: Recording) -> None:
    import torch

    episode(policy, recording, seed=0, steps=3)
    hidden = policy.chosen.engine.memory
    assert isinstance(hidden, torch.Tensor)
    assert hidden.grad_fn is None
    assert hidden.requires_grad is False
