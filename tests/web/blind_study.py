"""A blind study with a rehearsal robot: its directory, its run with the page, and its results."""

import os
import random
import re
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Self

ROOT = Path(__file__).parents[2]
ARM_NAMES = re.compile(rb"heron|magpie|aviary", re.IGNORECASE)
"""Texts that a blinded page must not contain."""
AVIARY = '''"""Two slow policies that reveal their names wherever possible."""
import logging, time
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.values.movement import Action
from vsnbench.values.decision import Decision, Diagnostics

class Heron(Policy):
    card = ModelCard("heron", weights_label="heron weights", weights_sha256="heron0" * 10)
    turns = 2
    def reset(self, goal, seed):
        self.left = self.turns
        print(self.card.name, "starts")
        logging.getLogger("aviary").warning("%s looks around", self.card.name)
    def act(self, observation):
        time.sleep(0.1)
        self.left -= 1
        diagnostics = Diagnostics(note="i am " + self.card.name, scalars={self.card.name: 1.0})
        return Decision(Action.TURN_LEFT if self.left >= 0 else Action.STOP, self.card.name, diagnostics)

class Magpie(Heron):
    card = ModelCard("magpie", weights_label="magpie weights", weights_sha256="magpie" * 10)
    turns = 3
'''
_STUDY = """\
title: Which of two finds its goal?
question: Which of the two succeeds more often on our robot, in our flat?
robot: simulated:quick.yaml@{camera}
site: {site}
pretend_real: true
arms:
  heron: {{model: "aviary:Heron"{own}}}
  magpie: {{model: "aviary:Magpie"}}
goals: [{goals}]
starting_positions: "1-{starts}"
protocol: {{max_actions: 20}}
seed: {seed}
"""
_ROOM = """\
name: room
title: A room
rooms: [{name: room, polygon: [[0, 0], [4, 0], [4, 3], [0, 3]]}]
walls:
  - {start: [0, 0], end: [4, 0]}
  - {start: [4, 0], end: [4, 3]}
  - {start: [4, 3], end: [0, 3]}
  - {start: [0, 3], end: [0, 0]}
objects: [{id: chair, category: chair, position: [3.2, 2.2], heading_deg: 180, size_m: [0.5, 0.5, 0.9]}]
starts: [{number: 1, position: [1.2, 1.2], heading_deg: 0}]
"""
"""A minimal site that renders fast."""
_GOALS = ("chair", "bed", "sofa")
PATIENCE_S = 180.0


def wait_until(condition: Any, what: str, patience_s: float = PATIENCE_S) -> None:
    """Poll until a condition holds.

    Raises:
        AssertionError: it does not hold in time.
    """
    deadline_s = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline_s, f"not within {patience_s:g} s: {what}"
        time.sleep(0.02)


def study_text(trials: int, seed: int, site: str = "apartment", camera: str = "160x120") -> str:
    """Return a study file with two arms, shared goals, and if possible a goal of one arm only.

    Args:
        trials: number of trials.
        seed: seed of the schedule.
        site: name or file of the site.
        camera: size of the robot's images in pixels, width x height.

    Raises:
        SystemExit: no schedule has this number of trials.
    """
    for starts in range(min(15, trials), 0, -1):
        goals, own = divmod(trials // starts, 2)
        if trials % starts == 0 and 1 <= goals <= len(_GOALS):
            text = ", goals: [toilet]" if own else ""
            shared = ", ".join(_GOALS[:goals])
            return _STUDY.format(own=text, goals=shared, starts=starts, seed=seed, site=site, camera=camera)
    raise SystemExit(f"{trials} trials are not possible; use 2 to 7, or a multiple of 8 to 15 starts, such as 75")


class BlindStudy:
    """A study in a directory, and its run, which ends with the context."""

    def __init__(self, directory: Path, trials: int, seed: int, *, in_one_room: bool = False) -> None:
        self.directory = directory
        self.trials = trials
        self.port = quiet_port(random.Random(f"{seed} {os.getpid()}"))
        self.kills = 0
        self.address = ""
        self._process: subprocess.Popen[bytes] | None = None
        self._environment = os.environ | {
            "PYTHONPATH": os.pathsep.join([str(ROOT), str(directory)]),
            "COLUMNS": "100",
            "VSNBENCH_OPERATOR": "lab",
        }
        (directory / "aviary.py").write_text(AVIARY)
        (directory / "room.yaml").write_text(_ROOM)
        turtlebot = (ROOT / "vsnbench" / "robots" / "profiles" / "turtlebot2.yaml").read_text()
        (directory / "quick.yaml").write_text(turtlebot.replace("angular_rad_s: 0.5", "angular_rad_s: 3"))
        where = ("room.yaml", "64x48") if in_one_room else ()
        (directory / "study.yaml").write_text(study_text(trials, seed, *where))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def study(self, *arguments: str) -> str:
        """Run `vsnbench study` and return its output."""
        done = subprocess.run([*_vsnbench("study", *arguments)], **self._options(), capture_output=True, check=False)
        assert done.returncode == 0, done.stderr.decode()
        return (done.stdout + done.stderr).decode()

    def start(self) -> None:
        """Start or continue the run."""
        with self.log.open("ab") as log:
            command = _vsnbench("study", "run", f"--console=:{self.port}")
            self._process = subprocess.Popen(
                command, **self._options(), stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )

    def wait_served(self) -> str:
        """Wait until the page is served, and return its address with the token."""

        def listens() -> bool:
            assert self.code is None, self.log.read_text()
            with socket.socket() as probe:
                return probe.connect_ex(("127.0.0.1", self.port)) == 0

        wait_until(listens, "the page is served")
        wait_until(lambda: re.search(rb"http://\S+", self.log.read_bytes()), "the run logs the page's address")
        found = set(re.findall(rb"http://\S+", self.log.read_bytes()))
        assert len(found) == 1, f"the address changed after a kill: {found}"
        self.address = found.pop().decode()
        return self.address

    def kill(self) -> None:
        """Kill the run with SIGKILL."""
        assert self._process is not None
        self._process.send_signal(signal.SIGKILL)
        self._process.wait()
        self.kills += 1

    @property
    def code(self) -> int | None:
        """Exit code of the run; None while it runs."""
        return None if self._process is None else self._process.poll()

    @property
    def pid(self) -> int:
        """Process id of the run."""
        assert self._process is not None
        return self._process.pid

    @property
    def log(self) -> Path:
        """Terminal output of all runs of the study."""
        return self.directory / "run.log"

    def rows(self, query: str) -> list[tuple[Any, ...]]:
        """Query the results database."""
        with closing(sqlite3.connect(self.directory / "results" / "vsnbench.db", timeout=60)) as database:
            return database.execute(query).fetchall()

    def _options(self) -> dict[str, Any]:
        return {"cwd": self.directory, "env": self._environment}


def _vsnbench(*arguments: str) -> Sequence[str]:
    return [sys.executable, "-m", "vsnbench.cli.main", *arguments]


def quiet_port(chance: random.Random) -> int:
    """Return a free port outside the ephemeral range, so that it stays free after a kill."""
    while True:
        port = chance.randrange(20_000, 30_000)
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) != 0:
                return port
