"""Load a dataset of `vsnbench export lerobot` with the real LeRobot, and compare every frame with the record.

Run it with a Python that has `lerobot[dataset]`, which is not vsnbench's:

    python check_lerobot.py dataset/ [--results results/]

It needs nothing of vsnbench. With `--results` it compares images, odometry and actions with the record.
"""

import argparse
import math
import sqlite3
import sys
from pathlib import Path

import numpy as np
from PIL import Image

MIN_PSNR_DB = 35.0
CAMERA, DEPTH = "observation.images.camera", "observation.images.depth"
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--results", type=Path, help="results directory that the dataset was exported from")
    parser.add_argument("--backend", default="pyav", help="LeRobot's video backend: pyav or torchcodec")
    arguments = parser.parse_args()

    import lerobot
    import torch
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    print(f"lerobot {lerobot.__version__}, torch {torch.__version__}, {arguments.backend}")
    opened = {"root": arguments.dataset, "video_backend": arguments.backend}
    dataset = LeRobotDataset("local/check", **opened)
    print(f"{dataset.num_episodes} episodes, {dataset.num_frames} frames, {dataset.fps} frames per second")
    failures = [
        *check_frames(dataset, arguments.results),
        *check_statistics(dataset),
        *check_loader(dataset, torch),
        *check_windows(LeRobotDataset("local/check", delta_timestamps=windows(dataset), **opened)),
        *check_one_episode(LeRobotDataset("local/check", episodes=[dataset.num_episodes - 1], **opened), dataset),
    ]
    for failure in failures:
        print(f"FAILED: {failure}")
    print("failed" if failures else "passed")
    return bool(failures)


def check_frames(dataset, results: Path | None) -> list[str]:
    """Iterate over all frames, and compare them with the record."""
    failures, psnr, depth_equal, compared = [], [], 0, 0
    rows = list(dataset.meta.episodes)
    actions = dataset.features["discrete_action"]["names"]["actions"]
    for index in range(len(dataset)):
        item = dataset[index]
        row = rows[int(item["episode_index"])]
        frame = int(item["frame_index"])
        if int(item["index"]) != index or not math.isclose(float(item["timestamp"]), frame / dataset.fps):
            failures.append(f"frame {index}: index {item['index']}, timestamp {item['timestamp']}")
        if item["task"] not in row["tasks"]:
            failures.append(f"frame {index}: task {item['task']!r} is not of {row['tasks']}")
        last = frame == row["length"] - 1
        if bool(item["next.done"]) != last or bool(item["next.success"]) != (last and row["vsnbench/success"]):
            failures.append(f"frame {index}: done {item['next.done']}, success {item['next.success']}")
        if results is None:
            continue
        recorded = recorded_step(results, row["vsnbench/episode"], frame, actions)
        for name, expected in recorded["numbers"].items():
            if not np.array_equal(item[name].numpy(), expected):
                failures.append(f"frame {index}: {name} is {item[name].tolist()}, recorded {expected}")
        shown = np.rint(item[CAMERA].numpy().transpose(1, 2, 0) * 255)
        psnr.append(psnr_db(shown, recorded["color"]))
        if DEPTH in item:
            depth_equal += bool(np.array_equal(item[DEPTH].numpy()[0], recorded["depth"]))
        compared += 1
    print(f"read {len(dataset)} frames, compared {compared}: state, action, discrete action, blocked")
    if psnr:
        print(f"PSNR of the images: {min(psnr):.1f} dB at least, {np.mean(psnr):.1f} dB on average")
        if min(psnr) < MIN_PSNR_DB:
            failures.append(f"PSNR {min(psnr):.1f} dB is below {MIN_PSNR_DB} dB")
    if DEPTH in dataset.features and compared:
        print(f"depth images equal to the record: {depth_equal} of {compared}")
        if depth_equal != compared:
            failures.append("depth images differ")
    return failures


def recorded_step(results: Path, episode: int, frame: int, actions: list[str]) -> dict:
    """Return a step of the record, read without vsnbench."""
    with sqlite3.connect(f"file:{results / 'vsnbench.db'}?mode=ro", uri=True) as database:
        database.row_factory = sqlite3.Row
        (directory,) = database.execute("SELECT images_directory FROM episode WHERE id = ?", (episode,)).fetchone()
        step = database.execute(
            "SELECT * FROM step WHERE episode_id = ? ORDER BY number LIMIT 1 OFFSET ?", (episode, frame)
        ).fetchone()
    images, number = results / directory, step["number"]
    depth = images / "depth" / f"{number:04d}.png"
    return {
        "numbers": recorded_numbers(step, actions),
        "color": np.asarray(Image.open(images / "rgb" / f"{number:04d}.jpg").convert("RGB"), float),
        "depth": np.asarray(Image.open(depth), np.float32) if depth.exists() else None,
    }


def recorded_numbers(step: sqlite3.Row, actions: list[str]) -> dict:
    """Return state, action and flags as the dataset must have them."""
    before, after = (
        [step[f"{when}_{name}"] for name in ("x_m", "y_m", "heading_rad")] for when in ("observed", "after")
    )
    if after[0] is None:
        after = before
    dx, dy = after[0] - before[0], after[1] - before[1]
    cos, sin = math.cos(before[2]), math.sin(before[2])
    moved = (cos * dx + sin * dy, -sin * dx + cos * dy, after[2] - before[2], float(step["action"] == "STOP"))
    return {
        "observation.state": np.array(before, np.float32),
        "action": np.array(moved, np.float32),
        "discrete_action": np.array(actions.index(step["action"])),
        "blocked": np.array(bool(step["blocked"])),
    }


def psnr_db(a: np.ndarray, b: np.ndarray) -> float:
    error = float(np.mean((a - b) ** 2))
    return math.inf if error == 0 else 10 * math.log10(255**2 / error)


def check_statistics(dataset) -> list[str]:
    """Compare `stats.json` with numpy on the columns, and on the decoded images."""
    failures = []
    for name, feature in dataset.features.items():
        found = dataset.meta.stats[name]
        if feature["dtype"] in ("video", "image"):
            expected = image_moments(dataset, name)
            # The statistics are those of the recorded pixels, before the codec.
            tolerance = 0.02 if feature["dtype"] == "video" else 1e-6
        else:
            values = np.array(dataset.hf_dataset.with_format("numpy")[name][:], float).reshape(len(dataset), -1)
            expected = {key: getattr(values, key)(axis=0) for key in ("min", "max", "mean", "std")}
            expected |= {key: np.quantile(values, share, axis=0) for key, share in QUANTILES.items()}
            tolerance = 1e-6
        failures += [
            f"statistics of {name}: {key} is {found[key].ravel()}, numpy has {value}"
            for key, value in expected.items()
            if not np.allclose(found[key].ravel(), value, rtol=tolerance, atol=tolerance)
        ]
        if found["count"].tolist() != [len(dataset)]:
            failures.append(f"statistics of {name}: count is {found['count']}")
    print(f"statistics of {len(dataset.features)} features compared with numpy")
    return failures


def image_moments(dataset, name: str) -> dict[str, np.ndarray]:
    """Return mean and standard deviation of the channels, an image at a time."""
    moments = []
    for index in range(len(dataset)):
        pixels = dataset[index][name].numpy().astype(float)
        moments.append((pixels.mean(axis=(1, 2)), (pixels**2).mean(axis=(1, 2))))
    mean, square = np.mean(moments, axis=0)
    return {"mean": mean, "std": np.sqrt(square - mean**2)}


def check_loader(dataset, torch) -> list[str]:
    """Read all frames in batches, as training does."""
    read = sum(len(batch["index"]) for batch in torch.utils.data.DataLoader(dataset, batch_size=8, shuffle=True))
    print(f"DataLoader: {read} frames")
    return [] if read == len(dataset) else [f"the DataLoader returned {read} of {len(dataset)} frames"]


def windows(dataset) -> dict[str, list[float]]:
    step_s = 1 / dataset.fps
    return {CAMERA: [-step_s, 0.0], "observation.state": [-step_s, 0.0], "action": [0.0, step_s, 2 * step_s]}


def check_windows(dataset) -> list[str]:
    """Read each frame with the one before it and the next actions."""
    failures = []
    for index in range(len(dataset)):
        item = dataset[index]
        if item[CAMERA].shape[0] != 2 or item["action"].shape != (3, 4):
            failures.append(f"frame {index}: shapes {item[CAMERA].shape}, {item['action'].shape}")
    print(f"windows of 2 images and 3 actions: {len(dataset)}")
    return failures


def check_one_episode(part, whole) -> list[str]:
    """Load the last episode alone."""
    first = whole.meta.episodes[whole.num_episodes - 1]["dataset_from_index"]
    same = [np.array_equal(part[k][CAMERA], whole[first + k][CAMERA]) for k in range(len(part))]
    print(f"last episode alone: {len(part)} frames")
    return [] if all(same) and first + len(part) == len(whole) else ["the last episode alone differs"]


if __name__ == "__main__":
    sys.exit(main())
