"""Checks that drivers sharing a PostgreSQL record run each trial exactly once.

    python benchmarks/shared_record.py [--repetitions 2] [--kills 8]

Three drivers run one campaign while the script kills and stops them at random. Two of them are ordinary processes and
can check whether the other is alive. The third runs in a separate process namespace, as on another machine: the script
stops it in the middle of an episode until its lease expires and another driver takes its trial, and then resumes it.
Takes about four minutes on two cores. Needs root for the namespace, and PostgreSQL's programs.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
from sqlalchemy import Engine, text

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.support.record_checks import print_faults, print_totals  # noqa: E402
from tests.results.postgresql_server import new_database, running_server  # noqa: E402 - found from any directory now
from vsnbench.results.schema.engine import open_engine  # noqa: E402
from vsnbench.results.writing.lifecycle import LEASE  # noqa: E402

STEPS = 6
TRIALS = 105
"""Trials per repetition in the embedded apartment: seven goals from fifteen starting positions."""


class Driver:
    """A `vsnbench run` process with its own results directory."""

    def __init__(self, name: str, folder: Path, url: str, repetitions: int, *, elsewhere: bool = False) -> None:
        self.name = name
        words = ["run", "--model", "forward", "--goal", "all", "--repetitions", str(repetitions), "--workers", "1"]
        words += ["--max-steps", str(STEPS), "--db", url, "--results", str(folder / name)]
        apart = ["unshare", "--pid", "--fork", "--mount-proc"] if elsewhere else []
        self._log = (folder / f"{name}.log").open("ab")
        command = [*apart, sys.executable, "-m", "vsnbench.cli.main", *words]
        self._process = subprocess.Popen(command, cwd=ROOT, stdout=self._log, stderr=self._log)
        self._elsewhere = elsewhere

    @property
    def ended(self) -> bool:
        """Whether the process has exited."""
        return self._process.poll() is not None

    def send(self, number: int) -> None:
        """Send a signal to the driver process."""
        if not self._elsewhere:
            self._process.send_signal(number)
            return
        for child in psutil.Process(self._process.pid).children():
            child.send_signal(number)

    def wait(self, timeout_s: float) -> int:
        """Wait for the process to exit and return its exit code."""
        code = self._process.wait(timeout_s)
        self._log.close()
        return code


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=2, help="number of repetitions, of 105 trials each")
    parser.add_argument("--kills", type=int, default=8)
    parser.add_argument("--patience", type=float, default=560, help="seconds until the script gives up")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with running_server() as server, tempfile.TemporaryDirectory(prefix="vsnbench-shared-") as folder:
        url = new_database(server)
        engine = open_engine(url)
        kills = drive(Path(folder), url, engine, given)
        sys.exit(0 if check_record(engine, kills, Path(folder)) else 1)


def drive(folder: Path, url: str, engine: Engine, given: argparse.Namespace) -> int:
    """Run the campaign to its end with kills; return the number of killed drivers."""
    chance = random.Random(given.seed)
    drivers = {name: Driver(name, folder, url, given.repetitions) for name in ("a", "b")}
    stopped = Driver("c", folder, url, given.repetitions, elsewhere=True)
    kills, held = 0, False
    planned = TRIALS * given.repetitions
    next_kill = planned - 10
    began = time.monotonic()
    while (still := left(engine)) != 0 and time.monotonic() - began < given.patience:
        time.sleep(chance.uniform(0.2, 1.2))
        if not held and running_in(engine, "c", folder):
            stopped.send(signal.SIGSTOP)
            held = True
            print(f"{time.monotonic() - began:5.0f} s  c, in its own namespace, stopped in the middle of an episode")
        for name, driver in drivers.items():
            if driver.ended:
                driver.wait(5)
                drivers[name] = Driver(name, folder, url, given.repetitions)
        if kills < given.kills and 0 < still <= next_kill:
            name = chance.choice(("a", "b"))
            drivers[name].send(signal.SIGKILL)
            drivers[name].wait(30)
            kills += 1
            next_kill = still - chance.randint(planned // 20, planned // 10)
            print(f"{time.monotonic() - began:5.0f} s  {name} killed; {still} trials left")
            drivers[name] = Driver(name, folder, url, given.repetitions)
    for driver in drivers.values():
        driver.wait(120)
    print(f"{time.monotonic() - began:5.0f} s  all trials have a result; c resumes")
    stopped.send(signal.SIGCONT)
    code = stopped.wait(120)
    print(f"{time.monotonic() - began:5.0f} s  c ended with {code}: {(folder / 'c.log').read_text().splitlines()[-3:]}")
    return kills


def left(engine: Engine) -> int:
    """Return the number of planned trials without a result, or -1 before there is a plan."""
    with engine.connect() as connection:
        if connection.execute(text("SELECT to_regclass('episode')")).scalar() is None:
            return -1
        return int(
            connection.execute(
                text(
                    "SELECT count(*) FROM trial WHERE NOT EXISTS (SELECT 1 FROM episode WHERE trial_id = trial.id "
                    "AND state IN ('awaiting', 'judged'))"
                )
            ).scalar_one()
        ) or (-1 if connection.execute(text("SELECT count(*) FROM trial")).scalar_one() == 0 else 0)


def running_in(engine: Engine, name: str, folder: Path) -> bool:
    """Return whether a driver has recorded a step of a running episode."""
    if left(engine) < 0:
        return False
    with engine.connect() as connection:
        return bool(
            connection.execute(
                text(
                    "SELECT count(*) FROM step JOIN episode ON episode.id = episode_id JOIN process ON process.id = "
                    "process_id WHERE state = 'running' AND command LIKE :where"
                ),
                {"where": f"%{folder / name}"},
            ).scalar_one()
        )


def check_record(engine: Engine, kills: int, folder: Path) -> bool:
    """Print the counts; return whether every trial has one result and no episode is inconsistent."""
    found = print_totals(engine)
    wrong = print_faults(engine)
    with engine.connect() as connection:
        waited = connection.execute(
            text(
                "SELECT max(extract(epoch FROM event.created_at - (SELECT max(recorded_at) FROM step WHERE episode_id "
                "= event.episode_id))) FROM event JOIN episode ON episode.id = event.episode_id JOIN process ON "
                "process.id = process_id WHERE kind = 'recovered' AND command LIKE :where"
            ),
            {"where": f"%{folder / 'c'}"},
        ).scalar()
    print(f"{kills:7d} drivers killed with SIGKILL")
    free_after = "never" if waited is None else f"{float(waited):.0f} s after its last step"
    print(f"       the trial of c was taken over {free_after} (lease {LEASE.total_seconds():.0f} s)")
    good = not wrong and found["trials"] >= 200 and found["campaigns"] == 1 and waited is not None
    print("every trial once" if good else f"WRONG: {', '.join(wrong) or 'too few trials, or no lease expired'}")
    return good


if __name__ == "__main__":
    os.environ["PYTHONUNBUFFERED"] = "1"
    main()
