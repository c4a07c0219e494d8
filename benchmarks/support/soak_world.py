"""Folder, database and commands that the programs about long runs share."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import Engine, create_engine
from sqlalchemy.pool import NullPool

from benchmarks.support.record_checks import count
from vsnbench.robots.profiles import embedded_profiles

ROOT = Path(__file__).resolve().parents[2]
ADDRESS = re.compile(r"http://\S+token=\S+")
MODEL = '''"""A random walk that takes 50 ms a step, as a small network does."""

import random
import time

from vsnbench import Action, Decision, ModelCard, Observation, Policy


class PacedWalk(Policy):
    card = ModelCard("paced-walk")

    def reset(self, goal: str, seed: int) -> None:
        self.chance = random.Random(seed)

    def act(self, observation: Observation) -> Decision:
        time.sleep(0.05)
        return Decision(self.chance.choice((Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)))
'''


@dataclass
class Command:
    """A `vsnbench` command of the soak, its output in a file."""

    name: str
    popen: "subprocess.Popen[bytes]"
    log: Path

    @property
    def output(self) -> str:
        """What it has printed."""
        return self.log.read_text(errors="replace")

    def address(self) -> str:
        """Wait for the address of its page."""
        give_up_s = time.monotonic() + 120
        while (found := ADDRESS.search(self.output)) is None:
            if self.popen.poll() is not None or time.monotonic() > give_up_s:
                raise SystemExit(f"{self.name} does not serve its page:\n{self.output[-2000:]}")
            time.sleep(0.2)
        return found[0]

    def interrupt(self) -> int | None:
        """End it with Ctrl-C and return its exit code; None if it goes on."""
        if self.popen.poll() is None:
            self.popen.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            return self.popen.wait(60)
        return None

    def end(self) -> None:
        """End it however it is."""
        if self.popen.poll() is None:
            self.popen.terminate()
            self.popen.wait(60)


class World:
    """The folder, database and environment that the commands share."""

    def __init__(self, folder: Path, url: str) -> None:
        self.folder = folder
        self.url = url
        self.engine: Engine = create_engine(url, poolclass=NullPool, isolation_level="AUTOCOMMIT")
        for name in ("tmp", "cache"):
            (folder / name).mkdir()
        profile = embedded_profiles()["turtlebot2"].read_text().replace("name: turtlebot2", "name: small")
        profile = re.sub(r"width: \d+", "width: 64", re.sub(r"height: \d+", "height: 48", profile))
        (folder / "small.yaml").write_text(profile)
        (folder / "paced_walk.py").write_text(MODEL)
        self.environment = {
            **os.environ,
            "TMPDIR": str(folder / "tmp"),
            "XDG_CACHE_HOME": str(folder / "cache"),
            "PYTHONPATH": str(ROOT),
        }

    def start(self, name: str, *words: str) -> Command:
        """Start a command with the shared record."""
        log = self.folder / f"{name.replace(' ', '-')}.log"
        command = [sys.executable, "-m", "vsnbench.cli.main", *words, "--results", "results", "--db", self.url]
        with log.open("ab") as sink:
            popen = subprocess.Popen(
                command,
                cwd=self.folder,
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stdout=sink,
                stderr=sink,
                start_new_session=True,
            )
        return Command(name, popen, log)

    def run(self, name: str, *words: str) -> Command:
        """Start a run of the small robot."""
        return self.start(name, "run", "--robot", "simulated:small.yaml", *words)

    def count(self, query: str) -> int:
        """Return the number that a query gives."""
        return count(self.engine, query)
