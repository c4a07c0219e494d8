"""A newcomer's first day as one script: installs a wheel, then types what README and the tutorial say, and times it.

usage: python scripts/newcomers_day.py [--vsnbench COMMAND] [--markdown FILE]

Without --vsnbench it builds the wheel of this checkout and installs it in a new virtual environment. The rehearsal's
operator is a browser at phone size. The script ends at the first command that does not do what the page promises.
"""

import argparse
import os
import random
import re
import subprocess
import sys
import tempfile
import time
import venv
from contextlib import ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.web.blind_study import quiet_port, wait_until
from tests.web.phone import GivenJudgement, chromium_of_phones, phone_in
from tests.web.tcp_relay import TcpRelay

ROOT = Path(__file__).resolve().parent.parent
EXTRAS = "viewer"
MODEL = """from vsnbench import Action, Decision, ModelCard, Policy, Sensor


class Spinner(Policy):
    card = ModelCard("spinner", sensors=frozenset({Sensor.RGB, Sensor.DEPTH, Sensor.ODOMETRY}))

    def reset(self, goal, seed):
        self.turns = 0

    def act(self, observation):
        self.turns += 1
        return Decision(Action.STOP if self.turns > 12 else Action.TURN_LEFT)
"""
FIRST = (
    ("first run of the README", "run --model pirlnav --goal chair --starts 1-3"),
    ("upper bound", "run --model oracle --goal chair --starts 1-3"),
    ("lower bound", "run --model random --goal chair --starts 1-3"),
    ("first table", "report"),
    ("episodes", "episodes list"),
)
SITE = (
    ("a flat to begin with", "init"),
    ("check the flat", "sites check lab.yaml"),
    ("its plan", "sites draw lab.yaml --output plan.pdf"),
    ("its rooms as the robot sees them", "sites render lab.yaml --output rooms.png"),
    ("is it solvable?", "run --model oracle --goal chair --site lab.yaml --starts 1-3"),
)
OWN_MODEL = (
    ("is the model well-formed?", "models check mylab.spinner:Spinner"),
    ("own model", "run --model mylab.spinner:Spinner --goal chair --site lab.yaml --starts 1-3"),
)
STUDY = (
    (
        "plan a study",
        "study new --arm il=pirlnav --arm chance=random --site apartment --goal chair,bed --starts 1-8 --seed 7",
    ),
    ("check it", "study check"),
    ("its power", "study plan"),
    ("lock it", "study lock"),
    ("run it", "study run"),
    ("unblind it", "study unblind --reason done"),
    ("conclusion", "study report"),
)
HAND_OVER = (
    ("report as a page", "report --output report/"),
    ("bundle", "bundle --study 1 study.zip"),
    ("verify as the reader", "verify study.zip"),
    ("this machine", "doctor"),
)


class Day:
    """Commands in one directory, with their times."""

    def __init__(self, command: list[str], directory: Path) -> None:
        self.command, self.directory = command, directory
        self.rows: list[tuple[str, str, float]] = []
        self.environment = os.environ | {"COLUMNS": "80", "VSNBENCH_OPERATOR": "newcomer"}

    def type(self, steps: tuple[tuple[str, str], ...]) -> None:
        """Run commands in turn.

        Raises:
            SystemExit: a command fails.
        """
        for title, arguments in steps:
            began = time.perf_counter()
            done = subprocess.run(
                [*self.command, *arguments.split()],
                cwd=self.directory,
                env=self.environment,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                check=False,
            )
            self.note(title, f"vsnbench {arguments}", time.perf_counter() - began)
            print(done.stdout + done.stderr, flush=True)
            if done.returncode:
                raise SystemExit(f"exit code {done.returncode}: vsnbench {arguments}")

    def note(self, title: str, typed: str, seconds: float) -> None:
        """Record a step."""
        self.rows.append((title, typed, seconds))
        print(f"\n== {title}: {typed}  ({seconds:.1f} s)", flush=True)

    def rehearse(self) -> None:
        """Rehearse a trial that an operator places and judges on a phone."""
        arguments = "run --model oracle --goal chair --starts 3 --rehearse"
        port, began = quiet_port(random.Random()), time.perf_counter()
        log = self.directory / "rehearsal.log"
        with ExitStack() as stack:
            run = subprocess.Popen(
                [*self.command, *arguments.split(), f"--console=:{port}"],
                cwd=self.directory,
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stderr=stack.enter_context(log.open("w")),
            )
            stack.callback(run.wait)
            stack.callback(run.kill)
            wait_until(lambda: run.poll() is not None or "token=" in log.read_text(), "the page is served")
            found = re.search(r"http://\S+token=\S+", log.read_text())
            if found is None:
                raise SystemExit(log.read_text())
            relay = stack.enter_context(TcpRelay(port))
            browser = stack.enter_context(chromium_of_phones(("127.0.0.1", relay, port)))
            phone = phone_in(browser, "Newcomer", "127.0.0.1", relay, found[0])
            phone.page.goto(phone.address)
            phone.sign_in()
            phone.page.wait_for_function("() => !document.getElementById('go').disabled")
            phone.press("#go")
            phone.page.wait_for_selector("#judging .judging-form", state="visible")
            phone.fill_judgement("#judging", GivenJudgement("", distance="0.84"))
            phone.confirm("#judging", GivenJudgement(""))
            phone.press("#finish-end")
            phone.press("#dialog [value=yes]")
            run.wait(timeout=60)
        self.note("rehearsal, operated from a phone", f"vsnbench {arguments} --console", time.perf_counter() - began)
        if run.returncode:
            raise SystemExit(f"exit code {run.returncode}: {log.read_text()}")


def install(directory: Path, day: Day) -> list[str]:
    """Build the wheel and install it; return the command that runs it."""
    began = time.perf_counter()
    pip = [sys.executable, "-m", "pip", "--quiet", "wheel", "--no-deps", "--wheel-dir", str(directory / "dist"), "."]
    subprocess.run(pip, cwd=ROOT, check=True)
    wheel = next((directory / "dist").glob("*.whl"))
    day.note("build the wheel", "pip wheel .", time.perf_counter() - began)
    began = time.perf_counter()
    venv.create(directory / "venv", with_pip=True)
    program = directory / "venv" / "bin"
    subprocess.run([program / "pip", "install", "--quiet", f"{wheel}[{EXTRAS}]"], check=True)
    day.note("install", f"pip install vsnbench[{EXTRAS}]", time.perf_counter() - began)
    return [str(program / "vsnbench")]


def main() -> None:
    """Run the day."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vsnbench", help="command of an existing installation")
    parser.add_argument("--markdown", type=Path, help="write the table of times to this file")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        lab = Path(temporary) / "lab"
        lab.mkdir()
        day = Day([given.vsnbench or ""], lab)
        if not given.vsnbench:
            day.command = install(Path(temporary), day)
        day.type(FIRST)
        day.type(SITE)
        (lab / "mylab").mkdir()
        (lab / "mylab" / "spinner.py").write_text(MODEL)
        day.type(OWN_MODEL)
        day.rehearse()
        day.type(STUDY)
        day.type(HAND_OVER)
    total = sum(seconds for *_, seconds in day.rows)
    table = ["| step | typed | s |", "| --- | --- | ---: |"]
    table += [f"| {title} | `{typed}` | {seconds:.1f} |" for title, typed, seconds in day.rows]
    table.append(f"| **together** | | **{total:.0f}** |")
    print("\n".join(table))
    if given.markdown:
        given.markdown.write_text("\n".join(table) + "\n")


if __name__ == "__main__":
    main()
