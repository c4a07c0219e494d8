"""Compares processor time, peak memory and output of commands with another commit's, in alternating runs.

    python benchmarks/compare_commits.py [COMMIT] [--rounds 3] [--trials 500]

The default is the last tag. Each commit runs from its own files with this interpreter's packages, its own caches, which
are empty at first, and the record that its own `run` wrote. The first column is the processor time of this tree; ratios
are this tree to the other commit, each of the smallest of all rounds, and above 1 is more. Bytes are those of stdout
and of the files of results.
"""

import argparse
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, nan
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).resolve().parents[1]
_CELLS = 90
"""Trials of one repetition: six goals, 15 starting positions."""
_BARE = """
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
try:
    from vsnbench.sites.site import load_site
    from vsnbench.values.movement import Action
except ModuleNotFoundError:  # names of an earlier commit
    from vsnbench.protocol.actions import Action
    from vsnbench.protocol.site import load_site
site = load_site("apartment")
with SimulatedRobot(site, load_profile("turtlebot2")) as robot:
    def turn():
        if hasattr(robot, "execute"):
            return robot.execute(Action.TURN_LEFT)
        return robot.drive(ProtocolParameters().movement_of(Action.TURN_LEFT))
    robot.begin(site.start(1), 0)
    for _ in range(100):
        robot.observe()
        turn()
"""
Use = tuple[float, float, int]
"""Processor seconds, peak MiB, bytes."""


class FailedCommandError(Exception):
    """A command of one of the trees failed."""


@dataclass(frozen=True)
class Tree:
    """Files of one commit, and the directory in which it works."""

    files: Path
    work: Path

    def measure(self, words: list[str], results: Path | None) -> Use:
        """Run Python with these words; results is a directory that the command writes."""
        caches = {
            "NUMBA_CACHE_DIR": str(self.work / "compiled"),
            "XDG_CACHE_HOME": str(self.work / "cache"),
            "PYTHONPYCACHEPREFIX": str(self.work / "bytecode"),
            "PYTHONDONTWRITEBYTECODE": "",  # else every command would translate the package again
        }
        environment = {**os.environ, "PYTHONPATH": str(self.files), **caches}
        with (self.work / "stdout").open("wb") as output, (self.work / "stderr").open("wb") as errors:
            command = [sys.executable, *words]
            process = subprocess.Popen(command, cwd=self.work, env=environment, stdout=output, stderr=errors)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise FailedCommandError(f"{words[-4:]} of {self.files}: {(self.work / 'stderr').read_text()[-500:]}")
        written = [self.work / "stdout", *(results.rglob("*") if results else ())]
        size = sum(file.stat().st_size for file in written if file.is_file())
        return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, size


def commands(number: int, trials: int) -> Mapping[str, tuple[list[str], str]]:
    """Return the commands of a round by name, with the directory that each writes."""
    of_module = ["-m", "vsnbench.cli.main"]
    repetitions = str(ceil(trials / _CELLS))
    one = ["--model", "forward", "--goal", "chair", "--starts", "1", "--max-steps", "3"]
    short = ["--model", "forward", "--goal", "all", "--max-steps", "3", "--repetitions", repetitions, "--workers", "1"]
    return {
        "one trial": ([*of_module, "run", *one, "--results", f"one{number}"], f"one{number}"),
        "--help": ([*of_module, "--help"], ""),
        "100 bare actions": (["-c", _BARE], ""),
        "short trials": ([*of_module, "run", *short, "--results", f"run{number}"], f"run{number}"),
        "report": ([*of_module, "report", "--all-tables", "--results", f"run{number}"], ""),
        "verify": ([*of_module, "verify", f"run{number}"], ""),
        "merge": ([*of_module, "db", "merge", f"run{number}", "--results", f"merged{number}"], f"merged{number}"),
    }


def smallest(trees: tuple[Tree, Tree], rounds: int, trials: int) -> dict[str, tuple[list[Use], list[Use]]]:
    """Return the measured values of both trees, by command.

    Of the first round, which compiles, only the trial counts: it has empty caches.

    A command that the other commit does not have yet is said and left out.
    """
    taken: dict[str, tuple[list[Use], list[Use]]] = {}
    gone: set[str] = set()
    for number in range(rounds + 1):
        for name, (words, results) in commands(number, trials).items():
            if name in gone:
                continue
            uses: dict[int, Use] = {}
            for place in (0, 1) if number % 2 else (1, 0):
                try:
                    uses[place] = trees[place].measure(words, trees[place].work / results if results else None)
                except FailedCommandError as failed:
                    if place == 0:
                        raise SystemExit(str(failed)) from failed
                    gone.add(name)
                    print(f"{name:30} left out: {failed}")
            if len(uses) == 2 and (number or name == "one trial"):
                pair = taken.setdefault(name if number else "one trial, caches empty", ([], []))
                for place, use in uses.items():
                    pair[place].append(use)
    return taken


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit", nargs="?", default="", help="default: the last tag")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--trials", type=int, default=500)
    options = parser.parse_args()
    git = ["git", "-C", str(HERE)]
    last_tag = subprocess.run([*git, "describe", "--tags", "--abbrev=0"], capture_output=True, text=True, check=False)
    commit = options.commit or last_tag.stdout.strip()
    if not commit:
        print("there is no tag to compare with; name a commit")
        return
    with TemporaryDirectory() as scratch:
        trees = (Tree(HERE, Path(scratch) / "now"), Tree(Path(scratch) / "files", Path(scratch) / "before"))
        for directory in (trees[0].work, trees[1].work, trees[1].files):
            directory.mkdir()
        archive = subprocess.run([*git, "archive", commit], capture_output=True, check=True).stdout
        subprocess.run(["tar", "-x", "-C", str(trees[1].files)], input=archive, check=True)
        print(f"{'compared with ' + commit[:16]:30}  cpu s  ratios of: cpu  peak memory  bytes")
        for name, (now, before) in smallest(trees, options.rounds, options.trials).items():
            mine, theirs = ([min(values) for values in zip(*uses, strict=True)] for uses in (now, before))
            ratios = [own / other if other else nan for own, other in zip(mine, theirs, strict=True)]
            print(f"{name:30} {mine[0]:6.2f} {ratios[0]:15.2f} {ratios[1]:12.2f} {ratios[2]:6.2f}")


if __name__ == "__main__":
    main()
