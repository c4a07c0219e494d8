"""From a key or a touch on the driver's page to the next picture on the screen, in simulated trials.

    python benchmarks/key_to_picture.py
    python benchmarks/key_to_picture.py --touch --starts 1-5     # at the size of a phone

`vsnbench run --model oracle` records the trials first. `vsnbench run --model human:NAME` serves the page, on which a
Chromium repeats the oracle's actions from the same starting positions: by keys at 1280 px, or by touch at 390 px. A
person's own choice takes longer and is not part of the time, which runs in the browser from the event to the drawn
picture: request, guard, movement, record, new image, its transfer and decoding. Exits with 1 unless every trial ends as
the oracle's.
"""

import argparse
import os
import random
import re
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from playwright.sync_api import Page

from tests.cli.chromium import chromium
from tests.web.blind_study import quiet_port

KEYS = {"MOVE_FORWARD": "ArrowUp", "TURN_LEFT": "ArrowLeft", "TURN_RIGHT": "ArrowRight", "STOP": "Enter"}
ASKED = "#STOP[aria-disabled=false]"
MEASURE = """() => {
  window.times = [];
  let pressedAt = 0;
  const press = (event) => { pressedAt = pressedAt || event.timeStamp; };
  addEventListener("keydown", press, true);
  document.getElementById("pad").addEventListener("pointerdown", press, true);
  document.getElementById("begin").addEventListener("click", () => { pressedAt = 0; });
  document.getElementById("picture-image").addEventListener("load", () => requestAnimationFrame(() => {
    if (pressedAt) window.times.push(performance.now() - pressedAt);
    pressedAt = 0;
  }));
}"""


def run_command(results: Path, model: str, starts: str) -> list[str]:
    """Return the command of a campaign of chair trials."""
    return [
        *(sys.executable, "-m", "vsnbench", "run", "--model", model, "--goal", "chair"),
        *("--starts", starts, "--workers", "1", "--results", str(results)),
    ]


def rows(results: Path, query: str) -> list[tuple[int, str]]:
    """Return pairs of a starting position and a text from a record."""
    with closing(sqlite3.connect(results / "vsnbench.db")) as connection:
        return connection.execute(f"SELECT trial.start, {query}").fetchall()


def actions_of(results: Path) -> dict[int, list[str]]:
    """Return the recorded actions by starting position."""
    taken: dict[int, list[str]] = {}
    steps = "step.action FROM step JOIN episode ON episode.id = episode_id JOIN trial ON trial.id = trial_id"
    for start, action in rows(results, f"{steps} ORDER BY episode.id, step.number"):
        taken.setdefault(start, []).append(action)
    return taken


def outcomes_of(results: Path) -> list[tuple[int, str]]:
    """Return how each trial ended."""
    return rows(
        results, "verdict.reason FROM verdict JOIN episode ON episode.id = episode_id JOIN trial ON trial.id = trial_id"
    )


def drive(page: Page, address: str, taken: dict[int, list[str]], *, touch: bool) -> list[float]:
    """Repeat the actions of every trial through the page; return the seconds that each trial took."""
    page.goto(address)
    page.wait_for_selector("#begin")
    page.evaluate(MEASURE)
    durations_s = []
    for actions in taken.values():
        page.click("#begin")
        began_s = time.monotonic()
        for action in actions:
            page.wait_for_selector(ASKED)
            page.tap(f"#{action}") if touch else page.keyboard.press(KEYS[action])
        durations_s.append(time.monotonic() - began_s)
    return durations_s


def address_in(process: "subprocess.Popen[str]") -> str:
    """Return the address that a run prints."""
    assert process.stderr is not None
    for line in process.stderr:
        if found := re.search(r"https?://\S+token=\S+", line):
            return found[0]
    raise SystemExit("the run printed no address")


def main() -> int:
    """Measure and print; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", default="1-15", help="starting positions")
    parser.add_argument("--touch", action="store_true", help="touch at 390 px instead of keys at 1280 px")
    given = parser.parse_args()
    width, height = (390, 844) if given.touch else (1280, 800)
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        oracle, driven = Path(folder) / "oracle", Path(folder) / "driven"
        subprocess.run(run_command(oracle, "oracle", given.starts), check=True, capture_output=True)
        taken = actions_of(oracle)
        (Path(folder) / "vsnbench.toml").write_text(f"[console]\nport = {quiet_port(random.Random())}\n")
        command, paths = run_command(driven, "human:ada", given.starts), os.environ.get("PYTHONPATH", "")
        root = str(Path(__file__).resolve().parent.parent)
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, (root, paths)))}
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=folder, env=environment) as process:
            page = browser.new_context(viewport={"width": width, "height": height}, has_touch=given.touch).new_page()
            page.set_default_timeout(120_000)
            durations_s = drive(page, address_in(process), taken, touch=given.touch)
            page.get_by_text("The session has ended. Thank you.").wait_for()
            times_ms = sorted(page.evaluate("window.times"))
            process.communicate()
        same = outcomes_of(oracle) == outcomes_of(driven) and actions_of(driven) == taken
        successes = sum(text.startswith("success") for _, text in outcomes_of(driven))
    load = os.getloadavg()[0]
    print(f"{successes} of {len(taken)} trials succeeded, {'as' if same else 'NOT as'} with the oracle")
    print(f"a trial took {statistics.median(durations_s):.1f} s (median), {max(durations_s):.1f} s at most")
    print(
        f"{len(times_ms)} actions: median {statistics.median(times_ms):.0f} ms, "
        f"95 % {times_ms[int(0.95 * len(times_ms))]:.0f} ms, worst {times_ms[-1]:.0f} ms; load {load:.1f}"
    )
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
