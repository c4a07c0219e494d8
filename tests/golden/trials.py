"""Simulated trials: campaign keys, and a digest of the actions, poses, images, scores and verdict of every episode.

PIRLNav's scores are left out: their last bits depend on the processor, and on the runtime that is faster on a machine.
"""

import hashlib
import json
import sqlite3
from contextlib import closing
from pathlib import Path

from tests.golden.outputs import run

RUNS = (
    "run --model oracle --goal all",
    "run --model pirlnav --goal all",
    "run --model vlv,frontier --goal chair,sofa",
)
"""Command lines: 105 trials of the oracle, 90 of PIRLNav, 60 of VLV and frontier."""

_EPISODE = (
    "seed, state, end_reason, error, actions, path_length_m, geodesic_start_m, geodesic_end_m, distance_to_goal_m, "
)
_EPISODE += (
    "goal_instance, goal_in_sight, start_x_m, start_y_m, start_heading_rad, final_x_m, final_y_m, final_heading_rad"
)
_STEP = "number, raw_action, action, completed, stamp_s, observed_x_m, observed_y_m, observed_heading_rad, after_x_m, "
_STEP += "after_y_m, after_heading_rad, world_x_m, world_y_m, world_heading_rad, displacement_m, turn_rad, duration_s, "
_STEP += "corrections, collision_source, collision_touched, rgb_digest, depth_digest, {scores}movement"
_SCORES = "probabilities, details, "


def collect(directory: Path, runs: tuple[str, ...] = RUNS) -> dict[str, str]:
    """Run the trials into an empty directory. Returns a text by "model, goal, start" and by "model, key"."""
    results = directory / "results"
    for line in runs:
        answer = run(f"{line} --results {results} --keep none --unattended --quiet")
        if not answer.startswith("exit code 0"):
            raise RuntimeError(answer)
    with closing(sqlite3.connect(results / "vsnbench.db")) as database:
        campaigns = database.execute(
            "SELECT campaign.id, model.name, key FROM campaign JOIN model ON model.id = model_id ORDER BY campaign.id"
        ).fetchall()
        texts = {f"{model}, campaign key": key for _, model, key in campaigns}
        for campaign, model, _ in campaigns:
            columns = _STEP.format(scores="" if model == "pirlnav" else _SCORES)
            trials = f"SELECT id, goal, start FROM trial WHERE campaign_id = {campaign} ORDER BY goal, start"
            for trial, goal, start in database.execute(trials).fetchall():
                texts[f"{model}, {goal} from {start}"] = _episodes(database, trial, columns)
    return texts


def _episodes(database: sqlite3.Connection, trial: int, columns: str) -> str:
    """Return the ends of a trial's episodes in words, and a digest of all that was driven and seen."""
    words, digest = [], hashlib.sha256()
    for number, *facts in database.execute(f"SELECT id, {_EPISODE} FROM episode WHERE trial_id = {trial} ORDER BY id"):
        verdict = database.execute(
            f"SELECT proposed, success, end_reason, distance_m, goal_instance, goal_in_sight, author, source, reason "
            f"FROM verdict WHERE episode_id = {number} ORDER BY id"
        ).fetchall()
        steps = database.execute(f"SELECT {columns} FROM step WHERE episode_id = {number} ORDER BY number").fetchall()
        digest.update(json.dumps([facts, verdict, steps]).encode())
        words.append(f"{facts[2]} after {facts[4]}")
    return f"{', '.join(words)}; {digest.hexdigest()[:16]}"
