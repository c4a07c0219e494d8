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
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import psutil
from sqlalchemy import text

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.support.live_stream import save_live_stream  # noqa: E402
from benchmarks.support.process_samples import HALF_HOUR_S, SampleFile, bytes_below, read_samples, samples_of, table  # noqa: E402
from benchmarks.support.record_checks import print_faults, print_totals  # noqa: E402
from benchmarks.support.soak_clients import Client, ConsoleOperator, ResultsReader  # noqa: E402
from benchmarks.support.soak_world import Command, World  # noqa: E402
from tests.results.postgresql_server import new_database, running_server  # noqa: E402
from vsnbench.viewer.viewers import free_port  # noqa: E402

SAMPLE_S = 30.0
WARM_UP_S = 1200.0
SWEEP = ("--model", "random,forward", "--goal", "all", "--max-steps", "40", "--keep", "images", "--workers", "2")
ALONE = ("--goal", "chair", "--max-steps", "20", "--repetitions", "1000")
LOST = (
    "SELECT count(*) FROM trial JOIN campaign ON campaign.id = campaign_id JOIN model ON model.id = model_id WHERE "
    "model.name IN ('random', 'forward') AND EXISTS (SELECT 1 FROM episode JOIN trial AS of_same ON of_same.id = "
    "trial_id WHERE of_same.campaign_id = trial.campaign_id) AND NOT EXISTS (SELECT 1 FROM episode WHERE trial_id = "
    "trial.id AND state = 'judged')"
)
"""Number of trials of the sweep, in campaigns that were begun, without a result."""


def commands_of(world: World) -> Iterator[Command]:
    """Start the four commands."""
    yield world.run("sweep", *SWEEP, "--seed", "0-999")
    yield world.run("console", "--model", "oracle", *ALONE, "--rehearse", f"--console=:{free_port()}")
    live = world.run("live", "--model", "paced_walk:PacedWalk", *ALONE, "--isolate", "--live")
    yield live
    live.address()  # `browse` needs a record
    yield world.start("browse", "browse", "--port", "0")


class SecondViewer:
    """A viewer of the live stream that keeps what it is sent, in memory too: it is opened anew every half hour."""

    def __init__(self, world: World, command: Command) -> None:
        self._world, self._command = world, command
        self._popen: subprocess.Popen[bytes] | None = None
        self._since_s = 0.0
        self.refresh()

    @property
    def pid(self) -> int:
        """Process ID now."""
        assert self._popen is not None
        return self._popen.pid

    def refresh(self) -> None:
        """Open it, or open it anew after half an hour."""
        if self._popen is None or time.monotonic() - self._since_s > HALF_HOUR_S:
            self.close()
            file = self._world.folder / "live.rrd"
            file.unlink(missing_ok=True)
            self._popen = save_live_stream(self._command.address(), file, self._world.environment)
            self._since_s = time.monotonic()

    def close(self) -> None:
        """End it."""
        if self._popen is not None:
            self._popen.kill()
            self._popen.wait(30)


def soak(world: World, hours: float, stack: ExitStack) -> list[str]:
    """Run the commands, sample them, end them. Returns what is wrong."""
    began, wrong = time.monotonic(), []
    commands = []
    for command in commands_of(world):
        stack.callback(command.end)
        commands.append(command)
    by_name = {command.name: command for command in commands}
    viewer = SecondViewer(world, by_name["live"])
    stack.callback(viewer.close)
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
        viewer.refresh()
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
    viewer.close()
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
    print_totals(world.engine)
    wrong = print_faults(world.engine, left_out=("trials without a result",))
    lost = world.count(LOST)
    print(f"{lost:7d} trials of the sweep without a result")
    return wrong + [f"{lost} trials lost"] * bool(lost)


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
