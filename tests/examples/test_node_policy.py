"""The Node.js server conforms to docs/wire.md and runs a text goal with waypoints."""

import json
import shutil
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from websockets.sync.client import connect

from tests.cli.console import vsnbench
from tests.models.remote.servers import look
from vsnbench.errors import ModelError
from vsnbench.models.remote.checking import check_server
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.vsnbench_policy import pack, unpack
from vsnbench.models.synthetic import synthetic_task
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.values.goal import Goal, GoalKind
from vsnbench.values.movement import Waypoint

ROOT = Path(__file__).resolve().parents[2]
SERVER = ROOT / "examples" / "node_policy"
GOALS = """
goals:
  - {id: green-plant, kind: text, text: the green plant, targets: [{category: plant}]}
"""
NODE = shutil.which("node")
needs_node = pytest.mark.skipif(NODE is None, reason="node is missing: scripts/install_system.sh node installs it")


@contextmanager
def serving(**environment: str) -> Iterator[str]:
    process = subprocess.Popen(
        [str(NODE), "server.js", "0"],
        cwd=SERVER,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={"PATH": "/usr/bin:/bin", **environment},
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert " listens at ws://" in line, line
        yield line.split()[-1]
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with serving() as url:
        yield url


def test_the_example_has_under_200_lines_and_no_dependencies() -> None:
    assert sum(len(file.read_text(encoding="utf-8").splitlines()) for file in SERVER.glob("*.js")) < 200
    assert "dependencies" not in json.loads((SERVER / "package.json").read_text(encoding="utf-8"))


@needs_node
def test_the_server_passes_every_check_of_the_wire(server: str) -> None:
    findings = tuple(check_server(server))
    assert [finding for finding in findings if not finding.passed] == []
    assert len(findings) == 9


@needs_node
def test_it_answers_a_goal_in_words_with_a_waypoint_towards_its_colour(server: str) -> None:
    policy = RemotePolicy(server)
    seen = look(64, 48)
    red = seen.rgb.copy()
    red[:] = (90, 90, 90)
    red[10:, 40:60] = (220, 10, 10)  # right of the middle
    policy.begin(synthetic_task(Goal("red", GoalKind.TEXT, text="a red chair"), 0))
    decision = policy.act(type(seen)(red, seen.depth_m, seen.pose, 0.0, seen.camera))
    policy.close()
    assert isinstance(decision.movement, Waypoint)
    assert decision.movement.x_m > 0
    assert decision.movement.y_m < 0


@needs_node
def test_a_run_from_the_command_line_reaches_the_goal(
    server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lab = tmp_path / "lab.yaml"
    lab.write_text((ROOT / "sites" / "apartment.yaml").read_text(encoding="utf-8") + GOALS, encoding="utf-8")
    words = ("--model", server, "--site", str(lab), "--goal", "green-plant", "--starts", "8")
    ran = vsnbench(monkeypatch, capsys, "run", *words, "--results", str(tmp_path / "results"))
    assert ran.code == 0, ran.err
    with closing(sqlite3.connect(ResultsDirectory.locate(tmp_path / "results").path / "vsnbench.db")) as database:
        actions = [row[0] for row in database.execute("SELECT action FROM step ORDER BY number")]
        outcomes = database.execute("SELECT success, end_reason FROM verdict").fetchall()
    assert "WAYPOINT" in actions
    assert outcomes == [(1, "stop")]


@needs_node
@pytest.mark.parametrize(
    ("first", "code"),
    [
        (pack({"type": "hello", "wire": 1, "token": "", "client": "old"}), "version"),
        (pack({"type": "hello", "wire": 3, "newest_wire": 9, "token": "", "client": "new"}), "version"),
        (pack({"type": "reset", "seq": 1}), "protocol"),
        (b"\xc1", "protocol"),
        (pack({"type": "hello"})[:-1], "protocol"),
        (b"\x81\xa1a" + b"\xc7\x01\x01\x00", "protocol"),
        ("a text", "protocol"),
        (b"\x00" * (2**17), "protocol"),
    ],
)
def test_it_refuses_what_the_page_refuses(server: str, first: bytes | str, code: str) -> None:
    with connect(server, compression=None, proxy=None) as connection:
        connection.send(first)
        answer = unpack(connection.recv())
    assert (answer["type"], answer["code"]) == ("error", code)


@needs_node
def test_a_token_is_required_where_the_server_has_one() -> None:
    with serving(VSNBENCH_TOKEN="secret") as url:
        with pytest.raises(ModelError) as refused:
            RemotePolicy(url, token="wrong")
        assert refused.value.code == "wrong-token"
        RemotePolicy(url, token="secret").close()
