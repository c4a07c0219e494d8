"""Training runs the same network as the policy, many steps and lanes at once."""

from pathlib import Path

import numpy as np
import pytest
import torch

from tests.training.recipes import TINY
from training.cloning import Episodes, Lanes
from training.export import write_checkpoint
from training.networks import Inputs, compressed, learning_rate, new_network, recall
from training.recipe import Recipe, load_recipe
from training.shards import LABELS, Shard, inflection_weight, write_shard
from vsnbench.errors import UsageError
from vsnbench.models.pirlnav.policy import PIRLNav
from vsnbench.simulator.generated_sites.generate import SEEDS, Split

SIZES = TINY.network.architecture


def test_many_steps_at_once_answer_as_the_policys_network_step_by_step() -> None:
    network = new_network(SIZES, 1).eval()
    random = np.random.default_rng(0)
    steps, lanes = 5, 3
    images = random.integers(0, 256, (steps, lanes, 64, 64, 3), dtype=np.uint8)
    gps, compass = torch.randn(steps, lanes, 2), torch.randn(steps, lanes)
    goals, previous = torch.randint(6, (steps, lanes)), torch.randint(5, (steps, lanes))
    begins = torch.zeros(steps, lanes, dtype=torch.bool)
    begins[0], begins[3, 1] = True, True
    hidden = torch.randn(SIZES.recurrent_layers, lanes, SIZES.hidden_size)
    with torch.no_grad():
        features = compressed(network, images.reshape(-1, 64, 64, 3)).reshape(steps, lanes, -1)
        logits, after = recall(network, Inputs(features, gps, compass, goals, previous, begins), hidden)
        for lane in range(lanes):
            memory = hidden[:, lane : lane + 1]
            for step in range(steps):
                answer, _, memory = network(
                    torch.from_numpy(images[step, lane][None]).float() / 255,
                    gps[step, lane][None],
                    compass[step, lane].reshape(1, 1),
                    goals[step, lane][None],
                    previous[step, lane][None],
                    1.0 - begins[step, lane].float().reshape(1, 1),
                    memory,
                )
                assert torch.allclose(answer[0], logits[step, lane], atol=1e-4)
            assert torch.allclose(memory, after[:, lane : lane + 1], atol=1e-4)


def test_an_exported_network_runs_as_the_model_and_fits_the_wheel(tmp_path: Path) -> None:
    path = tmp_path / "w.ckpt"
    write_checkpoint(new_network(load_recipe("full").network.architecture, 0), 1000, path)
    assert path.stat().st_size <= 10_000_000
    model = PIRLNav(weights=path)
    assert "not the published model" in model.card.weights_label


def synthetic(rng: np.random.Generator, lengths: list[int]) -> Shard:
    count = sum(lengths)
    begins = np.zeros(count, np.bool_)
    begins[np.cumsum([0, *lengths[:-1]])] = True
    return Shard(
        images=np.zeros(count, np.uint8),
        ends=np.arange(1, count + 1),
        views=np.zeros((count, LABELS), np.float16),
        gps_m=rng.normal(size=(count, 2)).astype(np.float32),
        compass_rad=np.arange(count, dtype=np.float32),
        goals=np.zeros(count, np.uint8),
        previous=np.where(begins, 0, 2).astype(np.uint8),
        expert=rng.integers(0, 4, count).astype(np.int8),
        begins=begins,
    )


def episodes(directory: Path, lengths: list[int]) -> Episodes:
    shard = synthetic(np.random.default_rng(0), lengths)
    write_shard(directory / "s.npz", shard, {})
    np.save(directory / "s.npy", np.arange(len(shard), dtype=np.float16)[:, None])
    return Episodes([directory / "s.npz"], [directory / "s.npy"])


def test_lanes_run_through_whole_episodes_in_order_and_go_on_where_they_stood(tmp_path: Path) -> None:
    data = episodes(tmp_path, [7, 3, 12])
    straight, resumed = Lanes(data, (1, 2), 2), Lanes(data, (1, 2), 2)
    taken = [straight.take(5, 1.0) for _ in range(6)]
    features = torch.cat([batch.features for batch in taken])[..., 0]
    begins = torch.cat([batch.begins for batch in taken])
    follows = features[1:] == features[:-1] + 1
    assert bool((follows | begins[1:]).all())
    assert bool(begins[0].all())
    resumed.take(5, 1.0)
    other = Lanes(data, (1, 2), 2)
    other.drawn, other.at = list(resumed.drawn), list(resumed.at)
    assert torch.equal(other.take(5, 1.0).features, taken[1].features)


def test_steps_where_the_oracle_changes_its_action_weigh_more(tmp_path: Path) -> None:
    data = episodes(tmp_path, [7, 3, 12])
    batch = Lanes(data, (0,), 1).take(22, 1.0)
    changes = batch.previous != batch.expert + 1
    assert data.weight == pytest.approx(inflection_weight(data.shards))
    assert torch.allclose(batch.weights[changes], torch.tensor(data.weight, dtype=torch.float32))
    assert torch.equal(batch.weights[~changes], torch.ones(int((~changes).sum())))


def test_no_round_shares_a_flat_with_another_or_with_validation() -> None:
    recipe = load_recipe("full")
    rounds = [recipe.training_seeds(k) for k in range(recipe.demonstrations.dagger_rounds + 1)]
    seeds = [seed for seeds in rounds for seed in seeds]
    assert len(set(seeds)) == len(seeds)
    assert set(seeds) <= set(SEEDS[Split.TRAINING])
    held_out = [*recipe.validation_seeds, *recipe.calibration_seeds]
    assert len(set(held_out)) == recipe.validation.flats + recipe.calibration.flats
    assert set(held_out) <= set(SEEDS[Split.VALIDATION])


def test_a_seed_that_leads_out_of_the_training_split_is_refused() -> None:
    with pytest.raises(UsageError, match="outside the training split"):
        Recipe(name="r", seed=100).training_seeds(0)


def test_the_learning_rate_rises_and_then_falls() -> None:
    rates = [learning_rate(1.0, update, 1000) for update in range(1000)]
    assert max(rates) == pytest.approx(1.0)
    assert rates[0] < 0.1
    assert rates[-1] == pytest.approx(0.05, abs=0.01)
