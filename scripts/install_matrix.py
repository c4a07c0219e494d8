"""Installs the wheel in every supported way, runs trials with it and prints a table of times and sizes.

usage: install_matrix.py dist/vsnbench-*.whl PYTHON ... [--jobs N] [--cache DIRECTORY] [--markdown FILE]

Each PYTHON is an interpreter that every user may run. Needs root for the other user, and pipx and uv on the PATH. Every
cell has a home, a working directory and an environment of its own. A user other than root has no right to write to the
installed package.
"""

import argparse
import json
import os
import pwd
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path

WAYS = ("pip", "pipx", "uvx")
USERS = ("nobody", "root")
RUN = ("run", "--model", "pirlnav", "--goal", "chair", "--starts", "1-3")
TIMEOUT_S = 1800
KEPT = re.compile("PATH|LD_LIBRARY_PATH|LANG|LC_.*|.*_proxy|.*_PROXY|SSL_CERT_FILE|(PIP|UV)_.*")
"""Variables that a cell takes over; the others could change what it finds."""


@dataclass(frozen=True)
class Cell:
    """One installation."""

    python: str
    way: str
    user: str
    wheel: Path
    home: Path
    cache: Path

    def call(self, *words: str) -> tuple[str, float]:
        """Run a command in the cell's working directory. Returns its output and the seconds it took.

        Raises:
            RuntimeError: it failed.
        """
        account = pwd.getpwnam(self.user)
        environment = {name: value for name, value in os.environ.items() if KEPT.fullmatch(name)} | {
            "HOME": str(self.home),
            "PIP_CACHE_DIR": str(self.cache / f"pip-{self.user}"),
            "UV_CACHE_DIR": str(self.home / "uv"),
            "UV_PYTHON_DOWNLOADS": "never",
        }
        begin_s = time.monotonic()
        done = subprocess.run(
            words,
            cwd=self.home / "elsewhere",
            env=environment,
            user=account.pw_uid,
            group=account.pw_gid,
            extra_groups=[],
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
        )
        if done.returncode:
            raise RuntimeError(f"{' '.join(words)}: exit code {done.returncode}\n{done.stderr[-2000:]}")
        return done.stdout, time.monotonic() - begin_s

    def install(self) -> tuple[list[str], Path, float]:
        """Install the wheel. Returns the command `vsnbench`, the environment's directory and the seconds it took."""
        if self.way == "pip":
            environment = self.home / "venv"
            _, first_s = self.call(self.python, "-m", "venv", str(environment))
            _, second_s = self.call(str(environment / "bin/pip"), "install", "--quiet", str(self.wheel))
            return [str(environment / "bin/vsnbench")], environment, first_s + second_s
        if self.way == "pipx":
            _, seconds = self.call("pipx", "install", "--python", self.python, str(self.wheel))
            return [str(self.home / ".local/bin/vsnbench")], self.home / ".local/share/pipx/venvs/vsnbench", seconds
        command = ["uvx", "--python", self.python, "--from", str(self.wheel)]
        _, seconds = self.call(*command, "vsnbench", "--version")
        prefix, _ = self.call(*command, "python", "-c", "import sys; print(sys.prefix)")
        return [*command, "vsnbench"], Path(prefix.strip()), seconds

    def measure(self) -> str:
        """Install, run trials and report. Returns the row of the table."""
        command, environment, install_s = self.install()
        (package,) = (path.resolve() for path in environment.glob("lib/python*/site-packages/vsnbench"))
        for path in (package, *package.rglob("*")):
            path.chmod(path.stat().st_mode & ~0o222)
        files = [path for path in environment.rglob("*") if path.is_file()]
        megabytes = sum(path.stat().st_size for path in files if path.suffix not in (".pyc", ".nbi", ".nbc")) / 1e6
        has_torch = any(environment.glob("lib/python*/site-packages/torch"))
        _, run_s = self.call(*command, *RUN)
        _, report_s = self.call(*command, "report")
        listed, _ = self.call(*command, "episodes", "list", "--json")
        trials = sorted((row["start"], row["outcome"], row["actions"]) for row in json.loads(listed))
        version = subprocess.run([self.python, "-V"], capture_output=True, text=True, check=True).stdout.split()[1]
        times = " | ".join(f"{seconds:.0f}" for seconds in (install_s, run_s, report_s))
        outcome = ", ".join(f"{outcome} {actions}" for _, outcome, actions in trials)
        torch = "with PyTorch: " if has_torch else ""
        return f"| {version} | {self.way} | {self.user} | {megabytes:.0f} | {times} | {torch}{outcome} |"


@contextmanager
def homes(cache: Path, wheel: Path, cells: Sequence[tuple[str, str, str]]) -> Iterator[list[Cell]]:
    """Yield the cells, each with a home that belongs to its user."""
    with tempfile.TemporaryDirectory(prefix="vsnbench-matrix-") as base:
        Path(base).chmod(0o755)
        made = []
        for number, (python, way, user) in enumerate(cells):
            home = Path(base) / f"home{number}"
            (home / "elsewhere").mkdir(parents=True)
            place = cache / f"pip-{user}"
            place.mkdir(parents=True, exist_ok=True)
            for path in (home, home / "elsewhere", place):
                shutil.chown(path, user)
            made.append(Cell(python, way, user, wheel, home, cache))
        yield made


def row_of(cell: Cell) -> str:
    """Return the row of a cell, or of its failure."""
    try:
        return cell.measure()
    except (RuntimeError, ValueError, KeyError, OSError, subprocess.SubprocessError) as error:
        sys.stderr.write(f"{cell.python} {cell.way} {cell.user}: {error}\n")
        return f"| {cell.python} | {cell.way} | {cell.user} | FAILED | | | | |"
    finally:
        shutil.rmtree(cell.home, ignore_errors=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("wheel", type=Path)
    parser.add_argument("pythons", nargs="+")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "vsnbench-matrix-cache")
    parser.add_argument("--markdown", type=Path)
    given = parser.parse_args()
    table = [
        "| Python | way | user | MB | install s | run s | report s | trials: outcome and actions |",
        "| --- | --- | --- | ---: | ---: | ---: | ---: | --- |",
    ]
    cells = [(python, way, user) for user, way, python in product(USERS, WAYS, given.pythons)]
    with homes(given.cache, given.wheel.resolve(), cells) as made, ThreadPoolExecutor(given.jobs) as pool:
        for row in pool.map(row_of, made):
            table.append(row)
            print(row, flush=True)
            if given.markdown:
                given.markdown.write_text("\n".join(table) + "\n", encoding="utf-8")
    return any("FAILED" in row for row in table)


if __name__ == "__main__":
    sys.exit(main())
