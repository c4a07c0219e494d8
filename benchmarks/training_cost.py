"""Measures processor time of each part of training, and projects the full recipe.

Processor time of one thread (seconds, milliseconds per frame) hardly depends on other load on the machine.

python benchmarks/training_cost.py
"""

import tempfile
import time
from pathlib import Path

import numpy as np
import torch

from training.cloning import Episodes, Lanes
from training.flat_world import FlatWorld
from training.networks import NetworkStudent, compressed, new_network, recall
from training.recipe import load_recipe
from training.rollout import demonstrate
from training.seeing import Describer
from training.shards import write_shard


def main() -> None:
    torch.set_num_threads(1)
    recipe = load_recipe("full")
    plan, sizes = recipe.demonstrations, recipe.network
    network = new_network(sizes.architecture, 0)
    seed = recipe.training_seeds(0).start
    demonstrate(FlatWorld(recipe, seed), plan.model_copy(update={"episodes": 1}), np.random.default_rng(0))  # compiles

    began = time.process_time()
    world = FlatWorld(recipe, seed + 1)
    world_s = time.process_time() - began
    began = time.process_time()
    shard = demonstrate(world, plan, np.random.default_rng(0)).shard
    demonstration_s = (time.process_time() - began) / len(shard)
    began = time.process_time()
    few = plan.model_copy(update={"episodes": plan.lanes})
    driven = demonstrate(world, few, np.random.default_rng(0), NetworkStudent(network, 0)).shard
    dagger_s = (time.process_time() - began) / len(driven)

    images = np.stack([shard.image(k) for k in range(recipe.seeing.batch)])
    describer = Describer(network)
    began = time.process_time()
    for _ in range(4):
        describer(images).square().mean().backward()
    seeing_s = (time.process_time() - began) / 4
    began = time.process_time()
    with torch.no_grad():
        features = compressed(network, images).numpy().astype(np.float16)
    feature_s = (time.process_time() - began) / len(images)

    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory)
        write_shard(path / "s.npz", shard, {})
        np.save(path / "s.npy", np.resize(features, (len(shard), features.shape[1])))
        lanes = Lanes(Episodes([path / "s.npz"], [path / "s.npy"]), (0,), recipe.cloning.lanes)
        hidden = torch.zeros(sizes.recurrent_layers, recipe.cloning.lanes, sizes.hidden_size)
        began = time.process_time()
        for _ in range(4):
            logits, _ = recall(network, lanes.take(recipe.cloning.steps, 1.0), hidden)
            logits.square().mean().backward()
        cloning_s = (time.process_time() - began) / 4

    frames = plan.flats * len(shard)
    dagger_flats = plan.dagger_rounds * plan.dagger_flats
    dagger_frames = dagger_flats * plan.dagger_episodes * len(driven) / few.episodes
    cloning_updates = sum(recipe.cloning_updates(number) for number in range(plan.dagger_rounds + 1))
    hours = {
        "demonstrations": plan.flats * world_s + frames * demonstration_s,
        "DAgger episodes": dagger_flats * world_s + dagger_frames * dagger_s,
        "encoder": recipe.seeing.updates * seeing_s,
        "features": frames * feature_s,
        "cloning": cloning_updates * cloning_s,
    }
    print(f"a flat with light maps and expert's map {world_s:8.2f} s")
    print(f"a demonstrated frame                    {1e3 * demonstration_s:8.2f} ms   ({len(shard)} frames per flat)")
    print(
        f"a frame driven by an untrained student  {1e3 * dagger_s:8.2f} ms   "
        f"({len(driven) / few.episodes:.0f} per episode)"
    )
    print(f"an encoder update ({recipe.seeing.batch} frames)           {seeing_s:8.3f} s")
    print(f"features of a frame                     {1e3 * feature_s:8.2f} ms")
    print(f"a cloning update ({recipe.cloning.lanes} x {recipe.cloning.steps} steps)       {cloning_s:8.3f} s")
    print(f"\nthe full recipe: {frames:,} demonstrated frames, {dagger_frames:,.0f} of DAgger; processor hours:")
    for name, seconds in hours.items():
        print(f"  {name:20s} {seconds / 3600:6.2f}")
    print(f"  {'total':20s} {sum(hours.values()) / 3600:6.2f}")


if __name__ == "__main__":
    main()
