"""`vsnbench stress` from the command line, with trials in the apartment."""

import json
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from tests.cli.test_record_verbs import Done, vsnbench

CAMERA = ("--robot", "simulated:turtlebot2@64x48")
TRIALS = ("--model", "oracle", "--goal", "chair", "--starts", "1-2", "--max-steps", "40", *CAMERA)
STRESS = ("stress", *TRIALS, "--disturb", "odometry_drift,low_light", "--severity", "5", "--json")


def outcomes(results: Path) -> list[tuple[Any, ...]]:
    """Return all steps and image digests, independent of the process that recorded them."""
    query = """
        SELECT c.conditions, t.goal, t.start, s.number, s.action, s.world_x_m, s.world_y_m, s.rgb_digest, s.depth_digest
        FROM step s JOIN episode e ON e.id = s.episode_id JOIN trial t ON t.id = e.trial_id
        JOIN campaign c ON c.id = t.campaign_id ORDER BY 1, 2, 3, 4
    """
    with closing(sqlite3.connect(results / "vsnbench.db")) as connection:
        return connection.execute(query).fetchall()


def numbers(done: Done) -> Any:
    assert done.returncode == 0, done.stderr
    (model,) = json.loads(done.stdout)["models"]
    return {
        "undisturbed": model["undisturbed"]["successes"],
        "disturbed": [
            {name: row[name] for name in ("disturbance", "value", "successes", "loss", "p", "changed")}
            for row in model["disturbances"]
        ],
    }


@pytest.fixture(scope="module")
def stressed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Done]:
    results = tmp_path_factory.mktemp("stressed")
    figure = results / "figure.svg"
    return results, vsnbench(results, *STRESS, "--workers", "1", "--figure", str(figure))


def test_a_stress_test_runs_pairs_and_states_each_loss(stressed: tuple[Path, Done]) -> None:
    results, done = stressed
    (drift,) = numbers(done)["disturbed"]
    assert (drift["disturbance"], drift["value"]) == ("odometry_drift", 0.1)
    assert drift["changed"] > 0
    assert (results / "figure.svg").read_bytes().startswith(b"<?xml")


def test_a_disturbance_that_the_model_cannot_see_is_left_out_and_named_before_the_trials(
    stressed: tuple[Path, Done],
) -> None:
    _, done = stressed
    (model,) = json.loads(done.stdout)["models"]
    assert model["unseen"] == ["low_light"]
    before, trials, _ = done.stderr.partition("2 campaigns, up to 4 trials")
    assert trials
    assert "oracle: without low_light" in before
    assert "this stress test can show no loss" in before


def test_the_undisturbed_condition_is_a_plain_run_bit_for_bit(stressed: tuple[Path, Done], tmp_path: Path) -> None:
    plain = vsnbench(tmp_path, "run", *TRIALS, "--workers", "1", "--json")
    assert plain.returncode == 0, plain.stderr
    undisturbed = [row for row in outcomes(stressed[0]) if "disturbances" not in row[0]]
    assert outcomes(tmp_path) == undisturbed
    assert undisturbed
    # A stress test in the same record continues the plain campaign.
    more = vsnbench(tmp_path, *STRESS, "--workers", "1")
    assert "up to 4 trials, 2 of them done" in more.stderr
    assert outcomes(tmp_path) == outcomes(stressed[0])


def test_a_finished_stress_test_runs_nothing_and_states_the_same_again(stressed: tuple[Path, Done]) -> None:
    results, done = stressed
    before = outcomes(results)
    again = vsnbench(results, *STRESS, "--workers", "1")
    assert numbers(again) == numbers(done)
    assert "4 of them done" in again.stderr
    assert outcomes(results) == before


def test_two_workers_give_the_same_numbers(stressed: tuple[Path, Done], tmp_path: Path) -> None:
    two = vsnbench(tmp_path, *STRESS, "--workers", "2")
    assert numbers(two) == numbers(stressed[1])
    assert outcomes(tmp_path) == outcomes(stressed[0])


def test_trials_of_another_goal_in_the_record_are_neither_done_nor_in_the_result(
    stressed: tuple[Path, Done], tmp_path: Path
) -> None:
    results = tmp_path / "results"
    shutil.copytree(stressed[0], results)
    other = [{"chair": "sofa", "1-2": "1"}.get(word, word) for word in STRESS]
    done = vsnbench(results, *other, "--workers", "1")
    assert done.returncode == 0, done.stderr
    assert "2 campaigns, up to 2 trials: " in done.stderr
    (model,) = json.loads(done.stdout)["models"]
    assert [row["episodes"] for row in (model["undisturbed"], *model["disturbances"])] == [1, 1]
