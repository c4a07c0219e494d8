"""Runs all stages of a training run and skips finished ones, so a killed run resumes."""

import json
import logging
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import torch

from training.atomic_files import TrainingError, write_atomic
from training.calibration import calibrate_stop
from training.cloning import Episodes, train_cloning
from training.curves import draw_curves
from training.export import write_checkpoint
from training.flat_world import FlatWorld
from training.networks import NetworkStudent, new_network
from training.recipe import Recipe
from training.rollout import Student, demonstrate
from training.seeing import store_features, train_seeing, write_features
from training.shards import read_shard, write_shard
from training.stage import Row
from training.validation import Validator
from vsnbench.files.atomic import sweep_parts
from vsnbench.models.checkpoints.weights import file_sha256
from vsnbench.models.pirlnav.checkpoint import read_checkpoint
from vsnbench.models.pirlnav.network import PIRLNavNetwork
from vsnbench.runtime.child_process import end_with_parent

logger = logging.getLogger(__name__)
WEIGHTS = "pirlnav-embedded.ckpt"


def train(recipe: Recipe, output: Path, workers: int = 1) -> Path:
    """Run a recipe to its end.

    Args:
        recipe: the recipe.
        output: directory of the run; created if missing.
        workers: number of processes for demonstrations.

    Returns:
        The checkpoint.

    Raises:
        TrainingError: the disk is full, or the directory belongs to another recipe.
    """
    _claim(recipe, output)
    network = new_network(recipe.network.architecture, recipe.seed)
    load_start(network, recipe)
    rows: list[Row] = []
    shards: list[Path] = []
    features: list[Path] = []
    validator = Validator(recipe, recipe.validation_seeds, recipe.validation.episodes)
    for number in range(recipe.demonstrations.dagger_rounds + 1):
        student = None if number == 0 else output / f"cloning-{number - 1}.pt"
        made = _demonstrations(recipe, number, output, workers, student)
        if number == 0:
            rows += train_seeing(recipe, network, made, output)
        for path in made:
            features.append(_features_of(path))
            store_features(network, path, features[-1])
        shards += made
        episodes = Episodes(shards, features)
        rows += train_cloning(recipe, network, episodes, number, output, lambda: validator.examine(network))
        _write_log(rows, output)
    rows += calibrate_stop(recipe, network, output)
    _write_log(rows, output)
    path = output / WEIGHTS
    write_checkpoint(network, sum(len(read_shard(shard, with_images=False)) for shard in shards), path)
    _write_json(output / "result.json", _result(recipe, rows, path))
    return path


def load_start(network: PIRLNavNetwork, recipe: Recipe) -> None:
    """Load the recipe's initial weights into a network, if it has any.

    Raises:
        TrainingError: the file is missing, has another hash, or has other layer sizes.
    """
    path = recipe.start
    if path is None:
        return
    if not path.is_file():
        raise TrainingError(
            f"start: no file {path}", advice="set the recipe's start to the checkpoint to continue from"
        )
    if (found := file_sha256(path)) != recipe.start_sha256:
        raise TrainingError(f"start: {path} has SHA-256 {found}, the recipe expects {recipe.start_sha256 or 'none'}")
    checkpoint = read_checkpoint(path)
    if checkpoint.architecture != network.architecture:
        raise TrainingError(f"start: {path} has other layer sizes than the recipe's network")
    network.load_state_dict({name: torch.tensor(weight) for name, weight in checkpoint.weights.items()})


def _claim(recipe: Recipe, output: Path) -> None:
    """Create the directory for this recipe and remove temporary files of killed processes."""
    claim = output / "recipe.json"
    if claim.is_file():
        if json.loads(claim.read_text())["sha256"] != recipe.sha256:
            raise TrainingError(f"{output} contains a run of another recipe: choose another --output, or remove it")
        sweep_parts(output, below=True)
        return
    _write_json(claim, {"sha256": recipe.sha256, "recipe": recipe.model_dump(mode="json")})


def make_shard(recipe: Recipe, number: int, seed: int, path: Path, student: Path | None) -> int:
    """Run the episodes of one site and write the student's features and the shard; return the number of steps."""
    torch.set_num_threads(1)
    world = FlatWorld(recipe, seed)
    driver: Student | None = None
    if student is not None:
        network = new_network(recipe.network.architecture, recipe.seed)
        network.load_state_dict(torch.load(student, map_location="cpu", weights_only=True)["model"])
        driver = NetworkStudent(network, seed)
    plan = recipe.demonstrations_of(number)
    given = demonstrate(world, plan, np.random.default_rng([recipe.seed, seed, 1]), driver)
    provenance = {
        "recipe": recipe.sha256,
        "round": number,
        "seed": seed,
        "site": world.site.sha256,
        "camera": world.camera.model_dump(mode="json"),
    }
    if given.features is not None:
        write_features(_features_of(path), given.features)
    write_shard(path, given.shard, provenance)
    return len(given.shard)


def _features_of(shard: Path) -> Path:
    """Return the path of a shard's features."""
    return shard.parents[2] / "features" / shard.parent.name / f"{shard.stem}.npy"


def _demonstrations(recipe: Recipe, number: int, output: Path, workers: int, student: Path | None) -> list[Path]:
    """Make the missing shards of a round."""
    seeds = recipe.training_seeds(number)
    paths = [output / "demonstrations" / f"round-{number}" / f"{seed:06d}.npz" for seed in seeds]
    missing = [(seed, path) for seed, path in zip(seeds, paths, strict=True) if not path.is_file()]
    began, steps = time.perf_counter(), 0
    threads = torch.get_num_threads()
    if workers == 1:
        for done, (seed, path) in enumerate(missing, start=1):
            steps += make_shard(recipe, number, seed, path, student)
            _report(number, done, len(missing), steps, began)
    elif missing:
        with ProcessPoolExecutor(workers, get_context("spawn"), end_with_parent) as pool:
            jobs = [pool.submit(make_shard, recipe, number, seed, path, student) for seed, path in missing]
            for done, job in enumerate(jobs, start=1):
                steps += job.result()
                _report(number, done, len(missing), steps, began)
    torch.set_num_threads(threads)
    return paths


def _report(number: int, done: int, of: int, steps: int, began: float) -> None:
    pace = steps / (time.perf_counter() - began)
    logger.info("demonstrations of round %d: %d/%d flats, %d frames, %.1f frames/s", number, done, of, steps, pace)


def _result(recipe: Recipe, rows: list[Row], path: Path) -> dict[str, Any]:
    calibrated = [row for row in rows if row["stage"] == "calibration"]
    return {
        "weights": path.name,
        "weights_sha256": file_sha256(path),
        "bytes": path.stat().st_size,
        "recipe": recipe.name,
        "recipe_sha256": recipe.sha256,
        "seed": recipe.seed,
        "calibration": max(calibrated, key=lambda row: row["validation_successes"]),
    }


def _write_log(rows: list[Row], output: Path) -> None:
    text = "".join(json.dumps(row) + "\n" for row in rows)
    write_atomic(output / "log.jsonl", lambda file: file.write(text.encode()))
    draw_curves(rows, output / "curves.png")


def _write_json(path: Path, content: dict[str, Any]) -> None:
    text = json.dumps(content, indent=2) + "\n"
    write_atomic(path, lambda file: file.write(text.encode()))
