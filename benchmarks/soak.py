"""Two hours of continuous trials: does what the processes hold stay flat, and is each trial run once, and once only?

    python benchmarks/soak.py --hours 2 --folder /tmp/soak      # PostgreSQL's programs are needed
    python benchmarks/soak.py --table /tmp/soak                 # the table of the samples until now

Four commands share one PostgreSQL record and one results directory, at nice 10: a sweep over seeds with two workers; a
rehearsal with `--console`, whose operator is an HTTP and web socket client that does what the page does; a run with
`--live` and an isolated model, whose Rerun stream a second viewer follows; and `browse`, whose list a client keeps up
to date. Every 30 s, resident memory, threads, file descriptors and database connections of each process and its
children go to `samples.csv`. At the end Ctrl-C ends the commands, the sweep's unfinished campaigns are resumed, and the
record is checked. Exits with 1 if a trial is lost or has two results, or a process is left.
"""

import argparse
import os
import re
import signal
import subprocess
import sys
import time
import urllib.parse
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path

import psutil
from sqlalchemy import Engine, create_engine, text

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.support.process_samples import SampleFile, bytes_below, read_samples, samples_of, table  # noqa: E402
from benchmarks.support.soak_clients import Client, ConsoleOperator, ResultsReader  # noqa: E402
from tests.results.postgresql_server import new_database, running_server  # noqa: E402
from tests.web.browser import Browser  # noqa: E402
from vsnbench.robots.profiles import embedded_profiles  # noqa: E402
from vsnbench.viewer.viewers import _program, free_port  # noqa: E402

SAMPLE_S = 30.0
WARM_UP_S = 1200.0
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
SWEEP = ("--model", "random,forward", "--goal", "all", "--max-steps", "40", "--keep", "images", "--workers", "2")
ALONE = ("--goal", "chair", "--max-steps", "20", "--repetitions", "1000")
LOST = (
    "SELECT count(*) FROM trial WHERE campaign_id IN (SELECT campaign_id FROM trial JOIN episode ON trial_id = "
    "trial.id) AND NOT EXISTS (SELECT 1 FROM episode WHERE trial_id = trial.id AND state IN ('judged', 'awaiting'))"
)
TWICE = (
    "SELECT count(*) FROM (SELECT trial_id FROM episode WHERE state IN ('judged', 'awaiting') GROUP BY trial_id HAVING "
    "count(*) > 1) AS twice"
)


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
        self.engine: Engine = create_engine(url, pool_size=1, isolation_level="AUTOCOMMIT")
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
        with self.engine.connect() as connection:
            return int(connection.execute(text(query)).scalar_one())


def commands_of(world: World) -> Iterator[Command]:
    """Start the four commands."""
    yield world.run("sweep", *SWEEP, "--seed", "0-999")
    yield world.run("console", "--model", "oracle", *ALONE, "--rehearse", f"--console=:{free_port()}")
    live = world.run("live", "--model", "paced_walk:PacedWalk", *ALONE, "--isolate", "--live")
    yield live
    live.address()  # `browse` needs a record
    yield world.start("browse", "browse", "--port", "0")


def follow_live(world: World, command: Command) -> "subprocess.Popen[bytes]":
    """Start a second viewer of the live stream, which keeps what it is sent."""
    location = Browser(command.address()).enter().ask("GET", "/").headers["location"]
    (url,) = urllib.parse.parse_qs(urllib.parse.urlsplit(location).query)["url"]
    return subprocess.Popen(
        [str(_program()), "--save", str(world.folder / "live.rrd"), url],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=world.environment,
    )


def soak(world: World, hours: float, stack: ExitStack) -> list[str]:
    """Run the commands, sample them, end them. Returns what is wrong."""
    began, wrong = time.monotonic(), []
    commands = []
    for command in commands_of(world):
        stack.callback(command.end)
        commands.append(command)
    by_name = {command.name: command for command in commands}
    viewer = follow_live(world, by_name["live"])
    stack.callback(viewer.kill)
    clients: dict[str, Client] = {
        "console": ConsoleOperator(by_name["console"].address()),
        "browse": ResultsReader(by_name["browse"].address()),
    }
    roots = {command.name: command.popen.pid for command in commands}
    everything = {*psutil.Process().children(recursive=True)}
    samples, disk = SampleFile(world.folder / "samples.csv"), world.folder / "disk.txt"
    port = int(world.url.rpartition(":")[2].partition("/")[0])
    numbers = 0
    while (passed_s := time.monotonic() - began) < hours * 3600:
        samples.add(samples_of(roots | {"second viewer": viewer.pid}, port, passed_s))
        everything |= {*psutil.Process().children(recursive=True)}
        if numbers % 20 == 0:
            with disk.open("a") as file:
                file.write(f"{passed_s:7.0f} s  {disk_line(world)}\n")
        numbers += 1
        if ended := [command.name for command in commands if command.popen.poll() is not None]:
            wrong.append(f"ended before its time: {', '.join(ended)}")
            break
        time.sleep(max(0.0, began + numbers * SAMPLE_S - time.monotonic()))
    for name, client in clients.items():
        client.close()
        print(f"{name} client: {dict(client.counts)}; refused {dict(client.refused)}; ", end="")
        print(f"longest wait {client.longest_wait_s:.1f} s")
    for command in commands:
        code = command.interrupt()
        print(f"{command.name} ends with {code}")
        if code is None:
            wrong.append(f"{command.name} goes on after Ctrl-C")
            command.end()
        if "Traceback" in command.output:
            wrong.append(f"traceback in {command.log}")
    viewer.terminate()
    viewer.wait(30)
    print(f"{time.monotonic() - began:.0f} s; {disk_line(world)}")
    left = [process for process in everything if process.is_running() and "postgres" not in process.name()]
    return wrong + [f"left running: {left}"] * bool(left)


def disk_line(world: World) -> str:
    """Return what the record and the folders hold."""
    folders = {name: bytes_below(world.folder / name) / 2**20 for name in ("results", "tmp", "cache")}
    database = world.count("SELECT pg_database_size(current_database())") / 2**20
    judged = world.count("SELECT count(*) FROM episode WHERE state = 'judged'")
    open_connections = world.count("SELECT count(*) FROM pg_stat_activity WHERE datname = current_database()")
    sizes = ", ".join(f"{name} {size:.1f} MiB" for name, size in folders.items())
    return f"{judged} judged, {sizes}, database {database:.1f} MiB, {open_connections} connections"


def finish_sweep(world: World) -> None:
    """Resume the campaigns of the sweep that were started, so that each is complete."""
    query = (
        "SELECT DISTINCT seed FROM campaign JOIN trial ON campaign_id = campaign.id JOIN model ON model.id = model_id "
        "WHERE model.name IN ('random', 'forward') AND EXISTS (SELECT 1 FROM episode WHERE trial_id = trial.id)"
    )
    with world.engine.connect() as connection:
        seeds = sorted(int(row[0]) for row in connection.execute(text(query)))
    command = world.run("resumed", *SWEEP, "--seed", ",".join(map(str, seeds)))
    print(f"resumed over {len(seeds)} seeds: ends with {command.popen.wait(1200)}")


def record_faults(world: World) -> list[str]:
    """Print what became of the trials; return what is wrong."""
    sweep = "campaign_id IN (SELECT campaign.id FROM campaign JOIN model ON model.id = model_id WHERE model.name IN "
    found: Mapping[str, int] = {
        "episodes judged": world.count("SELECT count(*) FROM episode WHERE state = 'judged'"),
        "episodes void": world.count("SELECT count(*) FROM episode WHERE state = 'void'"),
        "trials of the sweep lost": world.count(f"{LOST} AND {sweep} ('random', 'forward'))"),
        "trials with two results": world.count(TWICE),
        "episodes still active": world.count(
            "SELECT count(*) FROM episode WHERE state IN ('claimed', 'placed', 'running')"
        ),
        "episodes with other steps than actions": world.count(
            "SELECT count(*) FROM episode WHERE actions <> (SELECT count(*) FROM step WHERE episode_id = episode.id)"
        ),
    }
    for name, count in found.items():
        print(f"{count:7d} {name}")
    return [f"{count} {name}" for name, count in list(found.items())[2:] if count]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--folder", type=Path, help="a new folder, which is kept", default=Path("soak"))
    parser.add_argument("--table", type=Path, metavar="FOLDER", help="print the table of a soak's samples")
    asked = parser.parse_args()
    if asked.table is not None:
        print("\n".join(table(read_samples(asked.table / "samples.csv"), WARM_UP_S)))
        return 0
    asked.folder.mkdir(parents=True)
    os.nice(10)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have started this with SIGINT ignored
    with ExitStack() as stack:
        world = World(asked.folder.resolve(), new_database(stack.enter_context(running_server())))
        stack.callback(world.engine.dispose)
        wrong = soak(world, asked.hours, stack)
        finish_sweep(world)
        wrong += record_faults(world)
    print("\n".join(table(read_samples(asked.folder / "samples.csv"), WARM_UP_S)))
    print("\n".join(wrong) or "every trial once, nothing left")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
