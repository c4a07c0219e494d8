"""A whole run of a tiny recipe: what it leaves, and that neither kill -9 nor a full disk loses more than one step."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
import torch

from tests.training.recipes import TINY
from training.atomic_files import TrainingError
from training.networks import new_network
from training.run import WEIGHTS, load_start, train
from training.shards import read_shard
from vsnbench.models.checkpoints.weights import file_sha256
from vsnbench.models.pirlnav.checkpoint import read_checkpoint
from vsnbench.simulator.generated_sites.generate import SEEDS, Split

pytestmark = pytest.mark.long
RUN = Path(__file__).with_name("run_tiny.py")
ROOT = RUN.parent.parent.parent
DEADLINE_S = 240.0


def start(output: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, str(RUN), str(output), *options]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that nothing disturbed."""
    output = tmp_path_factory.mktemp("whole") / "run"
    process = start(output)
    out, err = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, err
    assert out.strip() == str(output / WEIGHTS)
    return output


def test_a_run_ends_in_a_checkpoint_that_the_models_own_reader_takes(whole: Path) -> None:
    checkpoint = read_checkpoint(whole / WEIGHTS)
    assert checkpoint.architecture == TINY.network.architecture
    assert not checkpoint.fine_tuned
    shards = sorted((whole / "demonstrations").rglob("*.npz"))
    assert checkpoint.training_step == sum(len(read_shard(path)) for path in shards)


def test_recipe_seeds_and_the_weights_hash_are_recorded(whole: Path) -> None:
    result = json.loads((whole / "result.json").read_text())
    assert result["weights_sha256"] == file_sha256(whole / WEIGHTS)
    assert (result["recipe_sha256"], result["seed"]) == (TINY.sha256, TINY.seed)
    shards = sorted((whole / "demonstrations").rglob("*.npz"))
    notes = [json.loads(np.load(path)["provenance"].tobytes()) for path in shards]
    assert [note["round"] for note in notes] == [0, 0, 1]
    assert len({note["site"] for note in notes}) == 3
    assert all(note["seed"] in SEEDS[Split.TRAINING] for note in notes)


def test_the_log_and_the_curves_cover_every_stage(whole: Path) -> None:
    rows = [json.loads(line) for line in (whole / "log.jsonl").read_text().splitlines()]
    assert {row["stage"] for row in rows} == {"seeing", "cloning-0", "cloning-1", "calibration"}
    assert any("validation_successes" in row for row in rows)
    assert (whole / "curves.png").read_bytes().startswith(b"\x89PNG")


def test_the_bias_of_stop_that_did_best_is_in_the_weights(whole: Path) -> None:
    rows = [json.loads(line) for line in (whole / "log.jsonl").read_text().splitlines()]
    tried = [row for row in rows if row["stage"] == "calibration"]
    assert tuple(row["stop_bias"] for row in tried) == TINY.calibration.stop_biases
    best = max(tried, key=lambda row: row["validation_successes"])
    assert json.loads((whole / "result.json").read_text())["calibration"] == best
    name = "action_distribution.linear.bias"
    learnt = torch.load(whole / "cloning-1.pt", weights_only=True)["model"][name]
    shipped = read_checkpoint(whole / WEIGHTS).weights[name]
    assert float(shipped[0] - learnt[0]) == pytest.approx(best["stop_bias"], abs=0.01)
    assert np.allclose(shipped[1:], learnt[1:], atol=0.01)


def test_a_killed_run_goes_on_and_ends_in_the_same_weights(whole: Path, tmp_path: Path) -> None:
    output = tmp_path / "run"
    copy_data(whole, output)
    process = start(output)
    try:
        deadline = time.monotonic() + DEADLINE_S
        while not (output / "cloning-0.pt").is_file():
            assert process.poll() is None, process.communicate()[1]
            assert time.monotonic() < deadline
            time.sleep(0.002)
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()
    assert not (output / WEIGHTS).exists()
    train(TINY, output)
    assert file_sha256(output / WEIGHTS) == file_sha256(whole / WEIGHTS)
    assert not list(output.rglob(".*"))


def copy_data(whole: Path, output: Path) -> None:
    """Keep what was demonstrated and seen, so that only the memory is trained again."""
    output.mkdir()
    for name in ("recipe.json", "seeing.pt"):
        shutil.copy(whole / name, output / name)
    for name in ("demonstrations", "features"):
        shutil.copytree(whole / name, output / name)


def test_a_failed_write_loses_only_its_own_step(whole: Path, tmp_path: Path) -> None:
    output = tmp_path / "run"
    copy_data(whole, output)
    largest = max(path.stat().st_size for path in output.rglob("*") if path.name == "seeing.pt")
    process = start(output, "--largest", str(largest // 4))
    _, err = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 1
    assert "cannot write" in err.splitlines()[-1]
    assert "run the same command again" in err.splitlines()[-1]
    assert "Traceback" not in err
    assert not (output / "cloning-0.pt").exists()
    assert not list(output.rglob(".*"))
    train(TINY, output)
    assert file_sha256(output / WEIGHTS) == file_sha256(whole / WEIGHTS)


def test_the_workers_of_a_killed_run_end_too(tmp_path: Path) -> None:
    process = start(tmp_path / "run", "--workers", "2")
    try:
        deadline = time.monotonic() + DEADLINE_S
        while len(workers := children_of(process.pid)) < 3:  # two workers, and what keeps track of their semaphores
            assert process.poll() is None, process.communicate()[1]
            assert time.monotonic() < deadline
            time.sleep(0.01)
    finally:
        process.kill()
        process.communicate()
    deadline = time.monotonic() + 60
    while any(psutil.pid_exists(pid) for pid in workers):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def children_of(pid: int) -> list[int]:
    """Return the processes that a process has started and that still run."""
    return [child.pid for child in psutil.Process(pid).children()]


def test_a_directory_of_another_recipe_is_refused(whole: Path) -> None:
    with pytest.raises(TrainingError, match="another recipe"):
        train(TINY.model_copy(update={"seed": 1}), whole)


def test_a_recipe_continues_from_the_weights_it_names_and_refuses_others(whole: Path, tmp_path: Path) -> None:
    start = whole / WEIGHTS
    recipe = TINY.model_copy(update={"start": start, "start_sha256": file_sha256(start)})
    network = new_network(TINY.network.architecture, seed=7)
    load_start(network, recipe)
    expected = read_checkpoint(start).weights
    assert all(torch.equal(weight, torch.tensor(expected[name])) for name, weight in network.state_dict().items())
    with pytest.raises(TrainingError, match="SHA-256"):
        load_start(network, recipe.model_copy(update={"start_sha256": "0" * 64}))
    with pytest.raises(TrainingError, match="no file"):
        load_start(network, recipe.model_copy(update={"start": tmp_path / "none.ckpt"}))
    larger = TINY.network.model_copy(update={"hidden_size": 32}).architecture
    with pytest.raises(TrainingError, match="other layer sizes"):
        load_start(new_network(larger, seed=0), recipe)
