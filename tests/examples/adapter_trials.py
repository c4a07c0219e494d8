"""The adapters served by the commands of their page, and trials of vsnbench with them."""

import json
import re
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.cli.console import vsnbench
from tests.models.remote.servers import PATIENCE_S, STUB, await_port, free_port
from vsnbench.values.pose import Pose

ROOT = Path(__file__).resolve().parents[2]
ADAPTERS = ROOT / "examples" / "adapters"
UPSTREAM = Path(__file__).resolve().parent / "upstream"
PAGE = (ADAPTERS / "README.md").read_text(encoding="utf-8")
COMMANDS = dict(re.findall(r"^python (vsnbench_policy\.py \w+:(?:\w+).*)\n(vsnbench run .*)$", PAGE, re.MULTILINE))
VLFM = {"pointnav_policy_path": "data/pointnav_weights.pth", "depth_image_shape": [224, 224], "text_prompt": "a chair"}
SETTINGS = {
    "uninavid.json": {"model_path": "model_zoo/uninavid"},
    "navila.json": {"model_path": "navila-llama3-8b-8f", "question_file": "question.txt"},
    "goat.json": {"checkpoint": "ckpt.pth"},
    "vlfm.json": {"arguments": VLFM, "device": "cpu"},
}


@contextmanager
def process(
    *command: str, port: int, cwd: Path, python: str = sys.executable, patience_s: float = PATIENCE_S
) -> Iterator[None]:
    with (cwd / "server.log").open("ab") as log:
        started = subprocess.Popen([python, *command], cwd=cwd, stderr=log, stdout=log)
    try:
        await_port(port, started, patience_s)
        yield
    finally:
        started.kill()
        started.wait(PATIENCE_S)


def lay_out(directory: Path, *folders: Path) -> None:
    """Put the adapters, the server file, their settings and the contents of other folders into a directory."""
    for folder in (ADAPTERS, *folders):
        shutil.copytree(folder, directory, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    (directory / STUB.name).write_bytes(STUB.read_bytes())
    (directory / "question.txt").write_text("Seen: {frames} Now: <image>\nTask: {instruction}")
    for name, settings in SETTINGS.items():
        (directory / name).write_text(json.dumps(settings))


@contextmanager
def served(model: str, directory: Path, **settings: Any) -> Iterator[str]:
    """Serve a model with the command of the page; yield its address."""
    serves = next(serves for serves in COMMANDS if f":{model} " in serves)
    port = free_port()
    words = [*serves.replace("--port 8765", "").split(), "--port", str(port)]
    if settings:
        file = (
            directory / words[words.index("--settings") + 1] if "--settings" in words else directory / "settings.json"
        )
        kept = json.loads(file.read_text()) if file.exists() else {}
        file.write_text(json.dumps(kept | settings))
        words += [] if "--settings" in words else ["--settings", file.name]
    with process(*words, port=port, cwd=directory):
        yield f"ws://127.0.0.1:{port}"


FREE_POINT = "goals: [{ id: free-point, kind: point, targets: [{ point: [3.2, 0.5] }] }]\n"
"""Two metres ahead of start 8, with nothing in between."""
Step = tuple[str, str, dict[str, Any] | None]
"""Action, raw action and movement of a step."""


def driven(
    model: str,
    directory: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    goal: str = "",
    starts: str = "5",
    end: str = "stop",
    **settings: Any,
) -> list[Step]:
    """Serve a model and run the page's trial, or one to another goal; return the steps. `end`: how it must end."""
    with served(model, directory, **settings) as url:
        return tried(model, url, directory, monkeypatch, capsys, goal, starts, end)


def tried(
    model: str,
    url: str,
    directory: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    goal: str = "",
    starts: str = "5",
    end: str = "stop",
) -> list[Step]:
    """Run the page's trial of a model that is served, as `driven` does."""
    runs = next(runs for serves, runs in COMMANDS.items() if f":{model} " in serves)
    if goal:
        runs = re.sub(r"--goal \S+", f"--goal {goal}", runs)
    if goal == "free-point":
        site = (ROOT / "examples" / "goals.yaml").read_text(encoding="utf-8")
        site = re.sub(r"^goals:\n(.*\n)*", FREE_POINT, site, flags=re.MULTILINE)
        (directory / "points.yaml").write_text(site, encoding="utf-8")
        runs = runs.replace("examples/goals.yaml", str(directory / "points.yaml"))
    runs = runs.replace("examples/goals.yaml", str(ROOT / "examples" / "goals.yaml"))
    monkeypatch.chdir(directory)  # where a test may have a vsnbench.toml
    monkeypatch.setenv("VSNBENCH_ROBOT", "simulated:turtlebot2@160x120")
    arguments = runs.replace("ws://127.0.0.1:8765", url).split()[1:]
    arguments += ["--starts", starts, "--max-steps", "24", "--results", str(directory / "results")]
    answer = vsnbench(monkeypatch, capsys, *arguments)
    assert answer.code == 0, answer.err + (directory / "server.log").read_text()
    with closing(sqlite3.connect(directory / "results" / "vsnbench.db")) as database:
        rows = database.execute("SELECT action, raw_action, movement FROM step ORDER BY episode_id, number").fetchall()
        reasons = {reason for (reason,) in database.execute("SELECT end_reason FROM episode")}
    assert reasons == {end}, (directory / "server.log").read_text()
    return [(action, raw, json.loads(movement) if movement else None) for action, raw, movement in rows]


def poses(directory: Path) -> list[Pose]:
    """Return the poses of the trial relative to its start: at the start, and after each step."""
    with closing(sqlite3.connect(directory / "results" / "vsnbench.db")) as database:
        rows = database.execute("SELECT after_x_m, after_y_m, after_heading_rad FROM step ORDER BY number").fetchall()
    return [Pose(0.0, 0.0, 0.0), *(Pose(*row) for row in rows)]
