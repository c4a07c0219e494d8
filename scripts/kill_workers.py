"""Kills workers, drivers or cluster nodes during campaigns and checks the record.

python scripts/kill_workers.py workers --kills 50      workers of one campaign, with SIGKILL
python scripts/kill_workers.py drivers --kills 10      the driver, resumed by the same command: 4 minutes
python scripts/kill_workers.py served --workers 8      workers of a served model, and every third time its server
python scripts/kill_workers.py node                    a node of a Ray cluster of two: 4 minutes

Kills happen at random times. Afterwards every trial must have one result, and no process and no partial file may be
left. The exit code is 1 otherwise.
"""

import argparse
import os
import random
import secrets
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
from contextlib import closing, suppress
from pathlib import Path

import psutil

FORKED_FROM = "vsnbench.runner.executors.fork_server"
PYTHON = [sys.executable, "-m"]
GOALS = 7
"""Number of goals of the apartment, the site of the campaigns."""


def campaign(results: Path, *words: str) -> list[str]:
    return [*PYTHON, "vsnbench.cli.main", "run", *words, "--results", str(results)]


def log_of(results: Path) -> Path:
    """Return the log file of a record's drivers."""
    return results.parent / "drivers.log"


def start_driver(command: list[str], results: Path) -> "subprocess.Popen[bytes]":
    """Start a driver that writes its stderr to the log file."""
    with log_of(results).open("a") as log:
        return subprocess.Popen(command, stderr=log)


def workers_of(driver: psutil.Process) -> list[psutil.Process]:
    """Return a driver's workers and their fork server."""
    found = []
    with suppress(psutil.Error):
        for child in driver.children(recursive=True):
            with suppress(psutil.Error):  # the process has just ended
                if FORKED_FROM in child.cmdline():
                    found.append(child)
    return found


def judged(results: Path) -> int:
    with suppress(sqlite3.Error), closing(sqlite3.connect(results / "vsnbench.db", timeout=10)) as connection:
        return int(connection.execute("SELECT COUNT(*) FROM episode WHERE state = 'judged'").fetchone()[0])
    return 0


def an_episode_runs(results: Path) -> bool:
    with suppress(sqlite3.Error), closing(sqlite3.connect(results / "vsnbench.db", timeout=10)) as connection:
        return connection.execute("SELECT 1 FROM episode WHERE state = 'running'").fetchone() is not None
    return False


def kill_workers(results: Path, words: list[str], asked: argparse.Namespace, chance: random.Random) -> None:
    """Kill random workers, spread evenly over the trials, so that the campaign progresses between two kills."""
    killed, code = 0, 1
    while code != 0:
        process = start_driver(campaign(results, *words), results)
        while process.poll() is None:
            time.sleep(asked.within_s * chance.random())
            alive = workers_of(psutil.Process(process.pid))
            if killed < asked.kills and is_due(killed, results, asked) and alive and an_episode_runs(results):
                with suppress(psutil.Error):
                    chance.choice(alive).kill()
                    killed += 1
        code = process.wait()
        reason = log_of(results).read_text().strip().rpartition("\n")[2] if code else "done"
        print(f"exit {code}; {killed} workers killed so far, {judged(results)} trials judged: {reason}", flush=True)
    if killed < asked.kills:
        sys.exit(f"the campaign ended after {killed} kills")


def is_due(killed: int, results: Path, asked: argparse.Namespace) -> bool:
    """Return whether the campaign has reached its share of trials for the next kill."""
    return judged(results) * asked.kills >= GOALS * asked.starts * killed


def kill_drivers(results: Path, words: list[str], asked: argparse.Namespace, chance: random.Random) -> None:
    for killed in range(asked.kills):
        process = start_driver(campaign(results, *words), results)
        while process.poll() is None and not (is_due(killed, results, asked) and has_begun_episode(process, results)):
            time.sleep(0.05)
        time.sleep(asked.within_s * chance.random())
        if process.poll() is not None:
            sys.exit(f"the campaign ended after {killed} kills")
        orphans = workers_of(psutil.Process(process.pid))
        process.kill()
        process.wait()
        _, alive = psutil.wait_procs(orphans, timeout=10)
        if left := [worker.pid for worker in alive if worker.is_running() and worker.status() != psutil.STATUS_ZOMBIE]:
            sys.exit(f"workers outlived their driver: {left}")
        print(f"driver {killed + 1} killed at {judged(results)} trials; its {len(orphans)} workers ended", flush=True)
    if start_driver(campaign(results, *words), results).wait() != 0:
        sys.exit("the campaign did not resume")


def kill_served(results: Path, words: list[str], asked: argparse.Namespace, chance: random.Random) -> None:
    """Kill workers of a served model, and every third time its server, which restarts immediately."""
    address = int(words[1].rpartition(":")[2])
    serve = [*PYTHON, "vsnbench.cli.main", "models", "serve", "random", "--port", str(address)]
    serve += ["--sessions", str(asked.workers)]
    server = subprocess.Popen(serve, stderr=subprocess.DEVNULL)
    killed, ends = [0, 0], 0
    try:
        while True:
            while not is_open(address):
                time.sleep(0.05)
            process = start_driver(campaign(results, *words), results)
            while process.poll() is None:
                time.sleep(asked.within_s * chance.random())
                if (
                    sum(killed) >= asked.kills
                    or not is_due(sum(killed), results, asked)
                    or not an_episode_runs(results)
                ):
                    continue
                if sum(killed) % 3 == 2:
                    server.kill()
                    server.wait()
                    server = subprocess.Popen(serve, stderr=subprocess.DEVNULL)
                    killed[1] += 1
                elif alive := workers_of(psutil.Process(process.pid)):
                    with suppress(psutil.Error):
                        chance.choice(alive).kill()
                        killed[0] += 1
            ends += 1
            print(
                f"exit {process.returncode}; {killed[0]} workers and {killed[1]} servers killed so far, "
                f"{judged(results)} trials judged",
                flush=True,
            )
            if process.returncode == 0:
                break
            if ends > asked.kills:
                sys.exit("the campaign does not finish")
    finally:
        server.kill()
        server.wait()
    if sum(killed) < asked.kills:
        sys.exit(f"the campaign ended after {sum(killed)} kills")


def is_open(address: int) -> bool:
    with closing(socket.socket()) as probe:
        return probe.connect_ex(("127.0.0.1", address)) == 0


def has_begun_episode(process: "subprocess.Popen[bytes]", results: Path) -> bool:
    """Return whether one of a driver's workers runs an episode."""
    query = "SELECT p.pid FROM episode e JOIN process p ON p.id = e.process_id WHERE e.state = 'running'"
    with suppress(sqlite3.Error, psutil.Error), closing(sqlite3.connect(results / "vsnbench.db")) as connection:
        pids = {pid for (pid,) in connection.execute(query)}
        return any(worker.pid in pids for worker in workers_of(psutil.Process(process.pid)))
    return False


def kill_node(results: Path, words: list[str], asked: argparse.Namespace, chance: random.Random) -> None:
    del asked, chance
    ports = [port() for _ in range(2)]
    token = secrets.token_hex(16)
    known = os.environ | {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": token, "RAY_USAGE_STATS_ENABLED": "0"}
    known["GRPC_ENABLE_FORK_SUPPORT"] = "0"  # see docs/scale.md
    small = ["--num-cpus=1", "--object-store-memory=200000000", "--min-worker-port=0", "--max-worker-port=0"]
    here = f"/tmp/ray-{os.getpid()}"
    start = [*PYTHON, "ray.scripts.scripts", "start", *small]
    try:
        head = [f"--port={ports[0]}", f"--ray-client-server-port={ports[1]}", "--include-dashboard=false"]
        subprocess.run([*start, "--head", f"--temp-dir={here}", *head], env=known, check=True, capture_output=True)
        before = processes_with(token)
        subprocess.run([*start, f"--address=127.0.0.1:{ports[0]}"], env=known, check=True, capture_output=True)
        node = [found for found in processes_with(token) if found not in before]
        words = [*words, "--workers", f"ray://127.0.0.1:{ports[1]}"]
        process = subprocess.Popen(campaign(results, *words), env=known)
        while process.poll() is None and judged(results) < 5:
            time.sleep(0.5)
        of_node = [found for found in processes_with(token) if found not in before and is_of_node(found, node)]
        for found in of_node:
            with suppress(psutil.Error):
                found.kill()
        print(f"{len(of_node)} processes of a node killed at {judged(results)} trials", flush=True)
        if process.wait() != 0:
            sys.exit("the campaign did not resume")
    finally:
        for found in processes_with(token):
            with suppress(psutil.Error):
                found.kill()
        psutil.wait_procs(processes_with(token), timeout=10)
        shutil.rmtree(here, ignore_errors=True)


def port() -> int:
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def processes_with(token: str) -> list[psutil.Process]:
    """Return all other processes that were started with a Ray token."""
    found = []
    for process in psutil.process_iter():
        with suppress(psutil.Error):
            if process.environ().get("RAY_AUTH_TOKEN") == token and process.pid != os.getpid():
                found.append(process)
    return found


def is_of_node(process: psutil.Process, node: list[psutil.Process]) -> bool:
    """Return whether a process or one of its parents belongs to a node."""
    with suppress(psutil.Error):
        return process in node or any(parent in node for parent in process.parents())
    return False


def check_record(results: Path, trials: int) -> None:
    """Print the state of the record and exit with an error if something was lost, duplicated or left behind."""
    with closing(sqlite3.connect(results / "vsnbench.db")) as connection:
        query = "SELECT state, COUNT(*), COUNT(DISTINCT trial_id) FROM episode GROUP BY state ORDER BY state"
        states = connection.execute(query).fetchall()
        committed = connection.execute(
            "SELECT e.images_directory, s.number FROM step s JOIN episode e ON e.id = s.episode_id"
        ).fetchall()
    print(f"episodes by state: {states}")
    steps = {(directory, number) for directory, number in committed}
    lost = [step for step in steps if not (results / step[0] / "rgb" / f"{step[1]:04d}.jpg").is_file()]
    images = {
        (str(path.parent.parent.relative_to(results)), int(path.stem)) for path in results.glob("episodes/*/rgb/*.jpg")
    }
    parts = list(results.rglob("*.part"))
    running = [process.pid for process in psutil.process_iter() if str(results) in " ".join(cmdline(process))]
    print(f"{len(steps)} steps, {len(lost)} without an image, {len(images - steps)} images without a step")
    faults = log_of(results).read_text().count("Traceback") if log_of(results).exists() else 0
    print(f"{len(parts)} partial files, {len(running)} processes left, {faults} tracebacks of drivers")
    if ("judged", trials, trials) not in states or lost or images - steps or parts or running or faults:
        sys.exit("something was lost, duplicated or left behind")


def cmdline(process: psutil.Process) -> list[str]:
    with suppress(psutil.Error):
        return process.cmdline()
    return []


def main() -> None:
    """Run the campaign with kills, and check its record."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("what", choices=["workers", "drivers", "served", "node"])
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--within-s", type=float, default=1.0, help="maximum random delay of a kill, seconds")
    parser.add_argument("--starts", type=int, default=15)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    words = ["--model", "oracle", "--goal", "all", "--starts", f"1-{asked.starts}"]
    words += ["--workers", str(asked.workers)]
    kill = {"workers": kill_workers, "drivers": kill_drivers, "served": kill_served, "node": kill_node}[asked.what]
    with tempfile.TemporaryDirectory(prefix="vsnbench-kills-") as directory:
        results = Path(directory) / "results"
        if asked.what == "served":
            words[1] = f"ws://127.0.0.1:{port()}"
        kill(results, words, asked, random.Random(asked.seed))
        # A run without remaining trials removes the temporary files of the last kill.
        if asked.what != "served":
            subprocess.run(campaign(results, *words[:-2], "--workers", "1"), check=True, stderr=subprocess.DEVNULL)
        check_record(results, trials=GOALS * asked.starts)


if __name__ == "__main__":
    main()
