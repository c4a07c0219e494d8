"""Checks a blind study that is killed five times against plain runs.

The study compares three models, runs in recorded terminals from `study new` to `study report`, and receives SIGKILL
five times. The script checks that the schedule was kept, that no trial counts twice, and that every outcome equals that
of `vsnbench run` with the same seed. It searches everything that an operator can see of the blind run
(`operators_view.py`) for the models' names, labels and hashes; two sessions run with `--live`, and their streams are
searched too. 4 goals from 15 positions take about 15 minutes on two idle cores:

    python benchmarks/study_killed.py --starts 1-15
    python benchmarks/study_killed.py --starts 1-2 --goals bed,chair      # about 3 minutes
    python benchmarks/study_killed.py --looked-at DIRECTORY --starts 1-2  # only the checks of a study that has run
"""

import argparse
import json
import os
import random
import re
import signal
import sqlite3
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from operators_view import LiveStream, Terminal, call, files_below, find_names, inspection_commands

ARMS = ("pirlnav", "vlv", "forward")
SEED = "11"
LIVE = (0, 3)
"""Indices of the sessions that run with `--live`."""
COMPARED = ("outcome", "end_reason", "success", "actions", "distance_to_goal_m", "path_length_m")
SCHEDULE = (
    "SELECT s.rank, a.name, t.goal, t.start, e.id FROM study_trial s JOIN trial t ON t.id = s.trial_id "
    "JOIN study_arm a ON a.campaign_id = t.campaign_id "
    "LEFT JOIN episode e ON e.trial_id = t.id AND e.state = 'judged' ORDER BY s.rank"
)


def rows(query: str) -> list[tuple[object, ...]]:
    """Return rows of the study's database, or none while it is being written."""
    try:
        with sqlite3.connect("file:results/vsnbench.db?mode=ro", uri=True, timeout=10) as database:
            return database.execute(query).fetchall()
    except sqlite3.OperationalError:
        return []


def done() -> int:
    """Return the number of trials with a result."""
    return len(rows("SELECT DISTINCT trial_id FROM episode WHERE state = 'judged'"))


def run_killed(moments: list[int], began: float) -> set[str]:
    """Run the study to its end, with a kill at each number of finished trials; return its process titles."""
    titles: set[str] = set()
    for number, moment in enumerate([*moments, None]):
        live = number in LIVE
        terminal = Terminal(["study", "run", *(["--live"] if live else [])], Path(f"seen/terminal-{number}.txt"))
        stream = LiveStream(terminal, Path(f"seen/live-{number}.rrd"))
        while terminal.process.poll() is None and (moment is None or done() < moment):
            titles |= terminal.titles()
            if live:
                stream.poll()
            time.sleep(0.5)
        if moment is not None:
            terminal.process.send_signal(signal.SIGKILL)
        code = terminal.ended()
        stream.ended()
        ended = f"killed after {moment} trials" if moment is not None else f"the last session exits with {code}"
        print(f"{ended}, {time.monotonic() - began:.0f} s", flush=True)
    return titles


def plain_runs(goals: str, starts: str) -> None:
    """Run the same trials model by model, without a study."""
    for arm in ARMS:
        words = ("--goal", goals, "--starts", starts, "--seed", SEED, "--results", "plain", "--workers", "2")
        answer = call("run", "--model", arm, *words, "--keep", "none")
        assert answer.returncode == 0, answer.stderr


def outcomes(results: str) -> dict[tuple[object, ...], tuple[object, ...]]:
    """Return the outcome of each trial by model, goal and starting position, without void attempts."""
    listed = json.loads(call("episodes", "list", "--results", results, "--json").stdout)
    return {
        (episode["model"], episode["goal"], episode["start"]): tuple(episode[name] for name in COMPARED)
        for episode in listed
        if episode["outcome"] != "void"
    }


def model_names() -> Iterator[str]:
    """Yield the models' names, labels and hashes, and the abbreviations of hashes in the output."""
    yield from ARMS
    for row in rows("SELECT DISTINCT name, weights_label, weights_sha256, sha256 FROM model"):
        for word in filter(None, map(str, row)):
            yield word
            if re.fullmatch("[0-9a-f]{64}", word):
                yield from (word[:8], word[:12], word[:16])
    yield from (str(key) for (key,) in rows("SELECT key FROM campaign"))


def shown_episodes() -> list[int]:
    """Return the episodes to inspect: two of each arm, and up to three void ones."""
    found: list[int] = []
    for (campaign,) in rows("SELECT id FROM campaign"):
        of_it = f"SELECT e.id FROM episode e JOIN trial t ON t.id = e.trial_id WHERE t.campaign_id = {campaign}"
        found += [int(str(row[0])) for row in rows(f"{of_it} ORDER BY e.id LIMIT 2")]
    return found + [int(str(row[0])) for row in rows("SELECT id FROM episode WHERE state = 'void' LIMIT 3")]


def study(goals: str, starts: str, kills: int, began: float) -> None:
    """Create, lock and run a study with kills; keep what an operator sees below `seen`."""
    Path("seen").mkdir()
    arms = [word for arm in ARMS for word in ("--arm", arm)]
    for words in (("new", *arms, "--goal", goals, "--starts", starts, "--seed", SEED), ("lock",)):
        answer = call("study", *words)
        assert answer.returncode == 0, answer.stderr
    schedule = [row[:4] for row in rows(SCHEDULE)]
    Path("schedule.json").write_text(json.dumps(schedule))
    moments = sorted(random.Random(3).sample(range(1, len(schedule)), min(kills, len(schedule) - 1)))
    Path("seen/ps.txt").write_text("\n".join(sorted(run_killed(moments, began))))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", default="1-2")
    parser.add_argument("--goals", default="bed,chair,sofa,toilet")
    parser.add_argument("--kills", type=int, default=5)
    parser.add_argument("--looked-at", type=Path, metavar="DIRECTORY", help="working directory of a study that has run")
    asked = parser.parse_args()
    os.environ["PYTHONPATH"] = str(Path(__file__).resolve().parent.parent)
    os.chdir(asked.looked_at or tempfile.mkdtemp(prefix="vsnbench-study-"))
    began = time.monotonic()
    print(f"in {Path.cwd()}", flush=True)
    if asked.looked_at is None:
        study(asked.goals, asked.starts, asked.kills, began)
    schedule = [tuple(row) for row in json.loads(Path("schedule.json").read_text())]

    seen: dict[str, bytes] = {}
    refused = []
    for words in inspection_commands(shown_episodes()):
        answer = call(*words)
        if answer.returncode != 0:
            refused.append(words)
        seen[" ".join(words)] = answer.stdout + answer.stderr
    files = [*files_below("results", "seen")]
    named = find_names(model_names(), seen, files)
    print(f"searched: {len(seen)} commands, {len(files)} files, {time.monotonic() - began:.0f} s")
    print(f"occurrences of a model's name: {len(named)} {named[:9]}", flush=True)

    call("study", "unblind", "--reason", "every trial is done")
    plain_runs(asked.goals, asked.starts)
    ours, theirs = outcomes("results"), outcomes("plain")
    differ = [trial for trial in {*ours, *theirs} if ours.get(trial) != theirs.get(trial)]
    twice = rows("SELECT trial_id FROM episode WHERE state = 'judged' GROUP BY trial_id HAVING COUNT(*) > 1")
    void = rows("SELECT COUNT(*) FROM episode WHERE state = 'void'")[0][0]
    kept = [row[:4] for row in rows(SCHEDULE)] == schedule and all(row[4] is not None for row in rows(SCHEDULE))
    streams = [f"{file.stat().st_size / 1e6:.1f} MB" for file in sorted(Path("seen").glob("live-*.rrd"))]
    print(call("study", "report").stdout.decode())
    print(f"schedule kept, every trial judged: {kept}")
    print(f"trials that count twice: {len(twice)}; void attempts, run again: {void}")
    print(f"outcomes that differ from plain runs: {len(differ)} of {len(schedule)} {differ[:3]}")
    print(f"live streams: {', '.join(streams)}; commands that failed: {len(refused)} {refused[:3]}")
    print(f"{time.monotonic() - began:.0f} s")
    return 0 if kept and streams and len(ours) == len(schedule) and not (twice or differ or named or refused) else 1


if __name__ == "__main__":
    sys.exit(main())
