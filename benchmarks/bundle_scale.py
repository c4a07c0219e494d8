"""Measures `vsnbench bundle` for 100, 300 and 1,000 episodes.

    python benchmarks/bundle_scale.py --directory /var/tmp/bundle-1000

It measures wall time and processor time in seconds, peak memory in MiB and the size in MB, and checks that repeated
bundles are identical. It runs 20 oracle trials once, and copies their rows and images, with new UUIDs, into three
campaigns of 100, 200 and 700 episodes. The baseline reads the same files and appends them to one file. Before each
run, the script drops the files from the page cache. Each time includes flushing the output to disk.
"""

import argparse
import hashlib
import json
import os
import shutil
import sqlite3
import subprocess
import sys
import time
import uuid
from contextlib import closing
from pathlib import Path

CAMPAIGNS = (100, 200, 700)
_COPIED = ("step", "verdict")


def main() -> None:
    """Print one line of JSON for each number of episodes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--directory", type=Path, required=True)
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    results = arguments.directory / "results"
    if not (results / "vsnbench.db").exists():
        make_record(results)
    for last in range(1, len(CAMPAIGNS) + 1):
        print(json.dumps(measure(results, f"1-{last}", arguments.directory, arguments.repeats)), flush=True)


def make_record(results: Path) -> None:
    """Run 20 trials, and copy them until each campaign has its number of episodes."""
    base = results.with_name("base")
    run = [sys.executable, "-m", "vsnbench", "run", "--model", "oracle", "--goal", "chair,sofa", "--starts", "1-10"]
    subprocess.run([*run, "--keep", "images", "--results", str(base)], check=True)
    shutil.copytree(base, results)
    with closing(sqlite3.connect(results / "vsnbench.db")) as database:
        database.row_factory = sqlite3.Row
        episodes = [dict(row) for row in database.execute("SELECT * FROM episode ORDER BY id")]
        (campaign,) = [dict(row) for row in database.execute("SELECT * FROM campaign")]
        for number, wanted in enumerate(CAMPAIGNS, start=1):
            if number > 1:
                insert(database, "campaign", campaign | {"id": number, "key": uuid.uuid4().hex * 2, "seed": number})
            for place in range(len(episodes) if number == 1 else 0, wanted):
                add_copy(database, results, episodes[place % len(episodes)], number, place)
        database.commit()


def add_copy(
    database: sqlite3.Connection, results: Path, episode: dict[str, object], campaign: int, place: int
) -> None:
    """Copy an episode with its rows and files as a new repetition of its trial."""
    trial = dict(database.execute("SELECT * FROM trial WHERE id = ?", (episode["trial_id"],)).fetchone())
    number = database.execute("SELECT MAX(id) + 1 FROM episode").fetchone()[0]
    of_trial = database.execute("SELECT MAX(id) + 1 FROM trial").fetchone()[0]
    insert(database, "trial", trial | {"id": of_trial, "campaign_id": campaign, "repetition": 2 + place, "rank": place})
    directory = f"episodes/{number:06d}"
    changed = {"id": number, "trial_id": of_trial, "uuid": str(uuid.uuid4()), "images_directory": directory}
    insert(database, "episode", episode | changed)
    for table in _COPIED:
        for row in database.execute(f"SELECT * FROM {table} WHERE episode_id = ?", (episode["id"],)).fetchall():
            own = {} if table == "step" else {"id": None}
            insert(database, table, dict(row) | {"episode_id": number} | own)
    shutil.copytree(results / str(episode["images_directory"]), results / directory)


def insert(database: sqlite3.Connection, table: str, row: dict[str, object]) -> None:
    """Insert a row, given as a mapping of column names to values."""
    names = ", ".join(f'"{name}"' for name in row)
    database.execute(f"INSERT INTO {table} ({names}) VALUES ({', '.join('?' * len(row))})", list(row.values()))


def measure(results: Path, campaigns: str, directory: Path, repeats: int) -> dict[str, object]:
    """Alternate bundling the campaigns with the plain copy, and return the best of all repeats."""
    output = directory / "bundle.zip"
    last = int(campaigns.partition("-")[2])
    files = files_of(results, last)
    found: dict[str, list[float]] = {"bundle_s": [], "cpu_s": [], "peak_mib": [], "copy_s": []}
    hashes = set()
    for _ in range(repeats):
        output.unlink(missing_ok=True)
        forget(files)
        began_s = time.monotonic()
        command = [sys.executable, "-m", "vsnbench", "bundle", "--campaign", campaigns, str(output), "--quiet"]
        process = subprocess.Popen([*command, "--results", str(results)], stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        assert status == 0
        flush(output)
        found["bundle_s"].append(time.monotonic() - began_s)
        found["cpu_s"].append(usage.ru_utime + usage.ru_stime)
        found["peak_mib"].append(usage.ru_maxrss / 1024)
        with output.open("rb") as file:
            hashes.add(hashlib.file_digest(file, "sha256").hexdigest())
        size = output.stat().st_size
        output.unlink()
        forget(files)
        found["copy_s"].append(copy_s(files, directory / "copy"))
    best = {name: round(min(values), 2) for name, values in found.items()}
    return {
        "episodes": sum(CAMPAIGNS[:last]),
        "files": len(files),
        "megabytes": round(size / 1e6),
        **best,
        "bundle_to_copy": round(best["bundle_s"] / best["copy_s"], 2),
        "same_bytes": len(hashes) == 1,
    }


def files_of(results: Path, last: int) -> list[Path]:
    """Return the image files of the campaigns up to number `last`."""
    query = "SELECT images_directory FROM episode e JOIN trial ON trial.id = trial_id WHERE campaign_id <= ? ORDER BY 1"
    with closing(sqlite3.connect(results / "vsnbench.db")) as database:
        directories = [results / row[0] for row in database.execute(query, (last,))]
    return [file for directory in directories for file in sorted(directory.rglob("*")) if file.is_file()]


def forget(files: list[Path]) -> None:
    """Remove files from the page cache."""
    os.sync()
    for path in files:
        with path.open("rb") as file:
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def flush(path: Path) -> None:
    """Flush a file to disk."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def copy_s(files: list[Path], target: Path) -> float:
    """Return the seconds needed to read all files and append them to one file."""
    began_s = time.monotonic()
    with target.open("wb") as file:
        for path in files:
            file.write(path.read_bytes())
    flush(target)
    taken_s = time.monotonic() - began_s
    target.unlink()
    return taken_s


if __name__ == "__main__":
    main()
