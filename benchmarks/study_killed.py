"""A blind study of three models, killed with SIGKILL five times on its way, against plain runs with the same seed.

From `study new` to `study report` as typed, in processes of their own. Says whether the schedule was kept, whether any
trial counts twice, whether every outcome is that of `vsnbench run`, and greps all that an operator sees of the blind
run for the models' names, labels and hashes. The issue's size takes some 25 minutes on two quiet cores:

    python benchmarks/study_killed.py --starts 1-15
    python benchmarks/study_killed.py --starts 1-2 --goals bed,chair      # some 3 minutes
"""

import argparse
import json
import os
import random
import re
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ARMS = ("pirlnav", "vlv", "forward")
ACTIONS = re.compile(rb"move[_ ]forward", re.IGNORECASE)
"""The action has the name of a model; it is in every recording whoever drives."""


def call(*words: str) -> "subprocess.CompletedProcess[bytes]":
    return subprocess.run([sys.executable, "-m", "vsnbench.cli.main", *words], capture_output=True, check=False)


def rows(query: str) -> list[tuple[object, ...]]:
    try:
        with sqlite3.connect("file:results/vsnbench.db?mode=ro", uri=True, timeout=10) as database:
            return database.execute(query).fetchall()
    except sqlite3.OperationalError:
        return []


SCHEDULE = (
    "SELECT s.rank, a.name, t.goal, t.start, e.success FROM study_trial s JOIN trial t ON t.id = s.trial_id "
    "JOIN study_arm a ON a.campaign_id = t.campaign_id LEFT JOIN (SELECT e.trial_id, v.success FROM episode e "
    "JOIN verdict v ON v.episode_id = e.id WHERE e.state = 'judged') e ON e.trial_id = t.id ORDER BY s.rank"
)


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--starts", default="1-2")
    parser.add_argument("--goals", default="bed,chair,sofa,toilet")
    parser.add_argument("--kills", type=int, default=5)
    asked = parser.parse_args()
    repository = Path(__file__).resolve().parent.parent
    os.environ["PYTHONPATH"] = str(repository)
    os.chdir(tempfile.mkdtemp(prefix="vsnbench-study-"))
    began, seen = time.monotonic(), b""
    arms = [word for arm in ARMS for word in ("--arm", arm)]
    for words in (("new", *arms, "--goal", asked.goals, "--starts", asked.starts, "--seed", "11"), ("lock",)):
        assert call("study", *words).returncode == 0, words
    schedule = [row[:4] for row in rows(SCHEDULE)]
    moments = sorted(random.Random(3).sample(range(1, len(schedule)), min(asked.kills, len(schedule) - 1)))
    for moment in moments:
        with Path("run.log").open("ab") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "vsnbench.cli.main", "study", "run"], stdout=log, stderr=log
            )
        while process.poll() is None and sum(row[4] is not None for row in rows(SCHEDULE)) < moment:
            time.sleep(0.2)
        process.send_signal(signal.SIGKILL)
        process.wait()
        print(f"killed after {moment} of {len(schedule)} trials, {time.monotonic() - began:.0f} s", flush=True)
    last = call("study", "run")
    print(f"study run ends with {last.returncode}, {time.monotonic() - began:.0f} s", flush=True)
    seen += last.stdout + last.stderr + Path("run.log").read_bytes()
    outcomes = rows(SCHEDULE)
    for words in (
        *(("study", "status"), ("study", "report"), ("study", "report", "--output", "study-report")),
        *(("episodes", "list", "--limit", "0"), ("episodes", "show", "1", "--json"), ("db", "status")),
        *(("report", "--all-tables"), ("report", "--output", "page")),
    ):
        answer = call(*words)
        assert answer.returncode == 0, (words, answer.stderr)
        seen += answer.stdout + answer.stderr
    hashes = rows("SELECT DISTINCT name, weights_label, weights_sha256, sha256 FROM model")
    telling = {str(word) for row in hashes for word in row if word} | set(ARMS)
    telling |= {word[:12] for word in telling if re.fullmatch("[0-9a-f]{64}", word)}
    files = [
        file for top in ("results/episodes", "page", "study-report") for file in Path(top).rglob("*") if file.is_file()
    ]
    places = {"screen": seen, **{str(file): file.read_bytes() + str(file).encode() for file in files}}
    patterns = {
        word: re.compile(rb"(?<![A-Za-z0-9])" + re.escape(word.encode()) + rb"(?![A-Za-z0-9])") for word in telling
    }
    told = [
        (place, word)
        for place, content in places.items()
        for word, pattern in patterns.items()
        if pattern.search(ACTIONS.sub(b"", content))
    ]
    twice = rows("SELECT trial_id FROM episode WHERE state = 'judged' GROUP BY trial_id HAVING COUNT(*) > 1")
    void = rows("SELECT COUNT(*) FROM episode WHERE state = 'void'")[0][0]
    plain: dict[tuple[object, ...], object] = {}
    for arm in ARMS:
        words = (
            "--goal",
            asked.goals,
            "--starts",
            asked.starts,
            "--seed",
            "11",
            "--results",
            "plain",
            "--workers",
            "1",
        )
        assert call("run", "--model", arm, *words).returncode == 0
    for one in json.loads(call("episodes", "list", "--results", "plain", "--json").stdout):
        plain[one["model"], one["goal"], one["start"]] = one["success"]
    differ = [row for row in outcomes if plain.get(tuple(row[1:4])) != (None if row[4] is None else bool(row[4]))]
    print(f"schedule kept: {[row[:4] for row in outcomes] == schedule}")
    print(f"trials that count twice: {len(twice)}; void attempts, run again: {void}")
    print(f"outcomes that are not those of plain runs: {len(differ)} of {len(outcomes)}")
    print(f"places in which a model is named: {len(told)} of {len(places)} {told[:3]}")
    print(f"{time.monotonic() - began:.0f} s in {Path.cwd()}")
    return 0 if [row[:4] for row in outcomes] == schedule and not (twice or differ or told) else 1


if __name__ == "__main__":
    sys.exit(main())
