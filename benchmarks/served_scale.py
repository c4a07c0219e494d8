"""Measures actions per second by number of workers, with local and served models.

python benchmarks/served_scale.py                          widest_opening, pirlnav and ConstantCall: 20 minutes
python benchmarks/served_scale.py --model pirlnav --workers 1,4,8
python benchmarks/served_scale.py --actions 10 --goal chair     shorter, for a first look

Each campaign runs with the model in the workers, then behind a server with one session per worker, and, if the model
supports it, with batches. Every trial must have one judged episode. Without batches, all campaigns of a model must have
the same actions, poses and images. `ConstantCall` takes 100 ms per call for any number of observations: it shows how
the server forms batches, and nothing about a real model. Rates run from the first to the last recorded action, without
start-up. Processor time is the marginal time of an action: that of a campaign minus that of a campaign with two actions
per trial. Other load on the machine affects the rates, but hardly the processor time. `added` is the median round trip
of an act minus the model's time, `queued` its part in the server's queue.
"""

import argparse
import hashlib
import json
import os
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil
from worker_scaling import STORY, processor_s

ROOT = Path(__file__).resolve().parents[1]
CONSTANT = "benchmarks.nodes.constant_call:ConstantCall"
MODELS = ("examples.widest_opening:WidestOpening", "pirlnav", CONSTANT)
BATCHING = ("pirlnav", CONSTANT)
COMMAND = (sys.executable, "-m", "vsnbench.cli.main")
ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
RATE = "SELECT count(*), (julianday(max(recorded_at)) - julianday(min(recorded_at))) * 86400 FROM step"
TRIALS = """
    SELECT count(*), min(judged), max(judged) FROM
    (SELECT t.id, sum(e.state = 'judged') AS judged FROM trial t LEFT JOIN episode e ON e.trial_id = t.id GROUP BY t.id)
"""


@dataclass
class Campaign:
    """Measurements of a campaign, and a hash of its actions, poses and images."""

    rate: float
    actions: int
    here_s: float
    server_s: float
    wire: list[dict[str, float]]
    story: str


@contextmanager
def server(model: str, sessions: int, batch: int) -> Iterator[tuple[str, psutil.Process]]:
    """Serve a model; yield its address and process."""
    words = ["models", "serve", model, "--port", "0", "--sessions", str(sessions), "--batch", str(batch)]
    with tempfile.NamedTemporaryFile(prefix="vsnbench-server-") as stream:
        log = Path(stream.name)
        process = subprocess.Popen([*COMMAND, *words], env=ENVIRONMENT, stderr=stream, cwd=ROOT)
        try:
            while " listens at " not in log.read_text():
                if process.poll() is not None:
                    sys.exit(log.read_text())
                time.sleep(0.1)
            yield log.read_text().split(" listens at ")[1].split()[0], psutil.Process(process.pid)
        finally:
            process.kill()
            process.wait()


def campaign(model: str, workers: int, goal: str, actions: int, served: psutil.Process | None) -> Campaign:
    """Run a campaign and measure it."""
    with tempfile.TemporaryDirectory(prefix="vsnbench-served-") as results:
        words = ["run", "--model", model, "--goal", goal, "--max-steps", str(actions), "--keep", "none"]
        words += ["--workers", str(workers), "--results", results]
        here_s, server_s = processor_s(), sum(served.cpu_times()[:2]) if served else 0.0
        subprocess.run([*COMMAND, *words], check=True, stderr=subprocess.DEVNULL, env=ENVIRONMENT, cwd=ROOT)
        here_s = processor_s() - here_s
        server_s = sum(served.cpu_times()[:2]) - server_s if served else 0.0
        with closing(sqlite3.connect(Path(results) / "vsnbench.db")) as database:
            trials, fewest, most = database.execute(TRIALS).fetchone()
            if (fewest, most) != (1, 1):
                sys.exit(f"{model}: the {trials} trials have {fewest} to {most} judged episodes each, expected 1")
            driven, seconds = database.execute(RATE).fetchone()
            story = hashlib.sha256(repr(database.execute(STORY).fetchall()).encode()).hexdigest()
            details = [json.loads(row[0] or "{}").get("wire") for row in database.execute("SELECT details FROM step")]
    return Campaign(driven / seconds, driven, here_s, server_s, [wire for wire in details if wire], story)


def measured(
    model: str, workers: int, asked: argparse.Namespace, served: psutil.Process | None
) -> tuple[Campaign, str]:
    """Return a campaign, and its marginal processor time per action as text."""
    short = campaign(model, workers, asked.goal, 2, served)
    whole = campaign(model, workers, asked.goal, asked.actions, served)
    more = whole.actions - short.actions
    times = [(whole.here_s - short.here_s) / more * 1000, (whole.server_s - short.server_s) / more * 1000]
    return whole, " ".join(f"{time_ms:10.1f}" for time_ms in times)


def line(name: str, workers: int, run: Campaign, times: str, alone: float) -> str:
    """Return a row of the table."""
    text = f"{name:28} {workers:7} {run.rate:9.1f} {run.rate / alone:6.2f} {times}"
    if not run.wire:
        return text
    added = statistics.median(transfer["round_trip_s"] - transfer["infer_s"] for transfer in run.wire) * 1000
    queued = statistics.median(transfer["queued_s"] for transfer in run.wire) * 1000
    model = statistics.median(transfer["infer_s"] for transfer in run.wire) * 1000
    batch = statistics.mean(transfer["batch"] for transfer in run.wire)
    return f"{text} {added:8.1f} {queued:9.1f} {model:8.1f} {batch:6.2f}"


def main() -> None:
    """Run the campaigns and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--model", default=",".join(MODELS), help="comma-separated models")
    parser.add_argument("--workers", default="1,2,4,8", help="comma-separated numbers of workers")
    parser.add_argument("--goal", default="chair,bed", help="comma-separated goals; 15 trials for each")
    parser.add_argument("--actions", type=int, default=20, help="maximum number of actions per episode")
    asked = parser.parse_args()
    print(f"load before: {os.getloadavg()[0]:.2f} on {len(os.sched_getaffinity(0))} cores")
    print(
        f"{'model':28} workers actions/s  ratio  harness ms  server ms added ms queued ms model ms  batch\n"
        f"{'':53} (processor time per action)",
        flush=True,
    )
    for model in asked.model.split(","):
        name, alone, stories = model.rpartition(":")[2], 0.0, set()
        for where in ("in the workers", "served", *(["served, batch"] if model in BATCHING else [])):
            for workers in map(int, asked.workers.split(",")):
                if "batch" in where and workers == 1:
                    continue
                if where == "in the workers":
                    run, times = measured(model, workers, asked, None)
                else:
                    with server(model, workers, workers if "batch" in where else 1) as (url, process):
                        run, times = measured(url, workers, asked, process)
                alone = alone or run.rate
                stories |= set() if "batch" in where else {run.story}
                print(line(f"{name} {where}"[:28], workers, run, times, alone), flush=True)
        print(
            f"{name}: {'the same' if len(stories) == 1 else 'NOT the same'} actions, poses and images without batches"
        )
        if len(stories) > 1:
            sys.exit(1)
    print(f"load after: {os.getloadavg()[0]:.2f}")


if __name__ == "__main__":
    main()
