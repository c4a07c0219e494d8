"""Checks records and results while processes and the database are killed at random.

    python benchmarks/kills.py --kills 1000 --folder /tmp/kills        # PostgreSQL's programs are needed

Three drivers share a PostgreSQL record; each has two workers and an isolated model, so that each worker has a process
of its model. One process after another gets SIGKILL, at random; of the database either a process that serves a
connection, after which PostgreSQL starts anew by itself, or its first process, after which this program starts it. A
driver that has ended is started again with the same command; when all trials are done, with more repetitions. In the
end one driver runs what is left. Exits with 1 if a trial is lost or has two results, an episode is torn, its images are
missing or left over, a child outlives its driver, or a process is left.
"""

import argparse
import os
import random
import signal
import sys
import time
from collections import Counter
from contextlib import ExitStack, suppress
from pathlib import Path

import psutil
from sqlalchemy import text
from sqlalchemy.exc import SQLAlchemyError

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.support.record_checks import print_faults, print_totals  # noqa: E402
from benchmarks.support.soak_world import Command, World  # noqa: E402
from tests.results.postgresql_server import PostgresqlServer, killable_server, new_database  # noqa: E402

WORKERS = 2
RUN = ("--model", "paced_walk:PacedWalk", "--isolate", "--workers", str(WORKERS), "--goal", "chair", "--max-steps", "4")
WEIGHTS = {"worker": 35, "model process": 32, "fork server": 14, "driver": 12, "connection": 4, "database": 3}
PAUSE_S = (0.05, 1.2)
MORE_REPETITIONS = 10
ORPHAN_LIMIT_S = 20.0
REPORT_EVERY = 25


class Drivers:
    """The drivers, each started again when it has ended."""

    def __init__(self, world: World, count: int, repetitions: int) -> None:
        self.world = world
        self.repetitions = repetitions
        self.ends: Counter[int] = Counter()
        self._commands = [self._start(number) for number in range(count)]

    def refresh(self) -> None:
        """Start those that have ended."""
        for number, command in enumerate(self._commands):
            if (code := command.popen.poll()) is not None:
                self.ends[code] += 1
                if code == 0:
                    self.repetitions += MORE_REPETITIONS
                self._commands[number] = self._start(number)

    def families(self, *, working: bool) -> list[tuple[str, psutil.Process]]:
        """Return the processes of all drivers with the role of each.

        Args:
            working: only of drivers whose workers have started their models.
        """
        found = []
        for command in self._commands:
            own = family(command.popen.pid)
            if not working or sum(role == "model process" for role, _ in own) >= WORKERS:
                found += own
        return found

    def finish(self) -> int:
        """End all drivers, run what is left with one, and return its exit code."""
        for command in self._commands:
            command.end()
        for _ in range(5):  # a trial whose model process was lost three times in a row ends a session
            last = self._start(0)
            if (code := last.popen.wait(1800)) == 0:
                break
        return code

    def _start(self, number: int) -> Command:
        return self.world.run(f"driver {number}", *RUN, "--repetitions", str(self.repetitions))


class Killer:
    """Kills processes, and watches what the kills leave."""

    def __init__(self, drivers: Drivers, server: PostgresqlServer, chance: random.Random, *, working: bool) -> None:
        self._drivers, self._server, self._chance, self._working = drivers, server, chance, working
        self.kills: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.longest_orphan_s = 0.0

    def kill_one(self) -> None:
        """Kill a process of a kind drawn at random."""
        if self._working and not self._drivers.families(working=True):
            return
        (kind,) = self._chance.choices(list(WEIGHTS), list(WEIGHTS.values()))
        if kind == "database":
            self._server.kill()
            time.sleep(self._chance.uniform(0, 2))
            self._server.start()
        elif not (victims := self._victims(kind)):
            return
        else:
            victim = self._chance.choice(victims)
            with suppress(psutil.Error):
                below = victim.children(recursive=True)
                victim.kill()
                self._watch(kind, below)
        self.kills[kind] += 1

    def _victims(self, kind: str) -> list[psutil.Process]:
        if kind == "connection":
            with suppress(psutil.Error, OSError):
                return [one for one in self._server.postmaster.children() if "lab test_" in " ".join(one.cmdline())]
            return []
        return [process for role, process in self._drivers.families(working=self._working) if role == kind]

    def _watch(self, kind: str, below: list[psutil.Process]) -> None:
        """Wait until the children of a killed process have ended."""
        began = time.monotonic()
        while running := [one for one in below if is_running(one)]:
            if time.monotonic() - began > ORPHAN_LIMIT_S:
                self.wrong.append(f"{len(running)} children outlive a {kind}: {running}")
                return
            time.sleep(0.02)
        self.longest_orphan_s = max(self.longest_orphan_s, time.monotonic() - began)


def is_running(process: psutil.Process) -> bool:
    """Return whether a process runs; a zombie does not."""
    with suppress(psutil.Error):
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    return False


def processes_in(world: World) -> list[psutil.Process]:
    """Return all processes with the environment of this program's commands, with any parent."""
    found, marker = [], f"TMPDIR={world.folder / 'tmp'}".encode()
    for process in psutil.process_iter():
        with suppress(OSError, psutil.Error):
            if marker in Path(f"/proc/{process.pid}/environ").read_bytes().split(b"\0"):
                found.append(process)
    return found


def image_faults(world: World) -> list[str]:
    """Return judged episodes without their images, and folders of images that no episode has."""
    query = "SELECT images_directory, actions FROM episode WHERE state = 'judged' AND images_directory <> ''"
    with world.engine.connect() as connection:
        kept = {str(row[0]): int(row[1]) for row in connection.execute(text(query))}
        known = set(connection.execute(text("SELECT images_directory FROM episode")).scalars())
    folder = world.folder / "results" / "episodes"
    there = {entry.name for entry in folder.iterdir()}
    known_names = {Path(name).name for name in known if name}
    short = [
        name for name, actions in kept.items() if len(list((folder / Path(name).name / "rgb").glob("*.jpg"))) < actions
    ]
    print(f"{len(kept):7d} judged episodes with images, {len(there)} folders")
    return [f"images missing of {len(short)} episodes: {short[:3]}"] * bool(short) + [
        f"{len(there - known_names)} folders of no episode: {sorted(there - known_names)[:3]}"
    ] * bool(there - known_names)


def progress_line(world: World, killer: Killer, drivers: Drivers, began: float) -> str:
    """Return what has happened until now."""
    judged = "?"
    with suppress(SQLAlchemyError):
        judged = str(world.count("SELECT count(*) FROM episode WHERE state = 'judged'"))
    return (
        f"{time.monotonic() - began:6.0f} s  {sum(killer.kills.values())} kills {dict(killer.kills)}; {judged} judged; "
        f"drivers ended with {dict(drivers.ends)}"
    )


def family(root: int) -> list[tuple[str, psutil.Process]]:
    """Return a command and its children, with the role of each in the command."""
    try:
        own = psutil.Process(root)
        found = [("driver", own)]
        for child in own.children(recursive=True):
            words = " ".join(child.cmdline())
            if "fork_server" in words:
                parent = child.parent()
                is_worker = parent is not None and "fork_server" in " ".join(parent.cmdline())
                role = "worker" if is_worker else "fork server"
            else:
                role = "model process"
            found.append((role, child))
    except psutil.Error:
        return []
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=1000)
    parser.add_argument("--minutes", type=float, default=60, help="the kills end after this time")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drivers", type=int, default=3)
    parser.add_argument("--working", action="store_true", help="kill only where workers have started their models")
    parser.add_argument("--folder", type=Path, default=Path("kills"), help="a new folder, which is kept")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True)
    os.nice(10)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    chance, began = random.Random(asked.seed), time.monotonic()
    with ExitStack() as stack:
        server = stack.enter_context(killable_server())
        world = World(asked.folder.resolve(), new_database(server.url))
        drivers = Drivers(world, asked.drivers, repetitions=MORE_REPETITIONS)
        stack.callback(lambda: [process.kill() for process in processes_in(world)])
        killer = Killer(drivers, server, chance, working=asked.working)
        reported = 0
        while sum(killer.kills.values()) < asked.kills and time.monotonic() - began < asked.minutes * 60:
            time.sleep(chance.uniform(*PAUSE_S))
            drivers.refresh()
            killer.kill_one()
            if sum(killer.kills.values()) >= reported + REPORT_EVERY:
                reported = sum(killer.kills.values())
                print(progress_line(world, killer, drivers, began), flush=True)
        print(progress_line(world, killer, drivers, began), flush=True)
        print(f"the rest: a driver ends with {drivers.finish()}, {time.monotonic() - began:.0f} s", flush=True)
        print_totals(world.engine)
        wrong = killer.wrong + print_faults(world.engine) + image_faults(world)
        print(f"{killer.longest_orphan_s:7.2f} s at most until the children of a killed process had ended")
        left, temporary = processes_in(world), list((world.folder / "tmp").iterdir())
        print(f"{len(left):7d} processes left, {len(temporary)} entries in the temporary folder")
        wrong += [f"left running: {left}"] * bool(left)
        wrong += [f"traceback in {log}" for log in world.folder.glob("*.log") if "Traceback" in log.read_text()]
    print("\n".join(wrong) or "every trial once, nothing left")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
