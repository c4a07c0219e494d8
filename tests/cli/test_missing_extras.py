"""A command whose extra is not installed names the extra in one line."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from vsnbench.installation import command_to_add

ROOT = Path(__file__).resolve().parents[2]

WITHOUT = """
import importlib.machinery, sys
hidden = set(sys.argv[1].split(","))
found = importlib.machinery.PathFinder.find_spec
def find(name, path=None, target=None):
    return None if name.partition(".")[0] in hidden else found(name, path, target)
importlib.machinery.PathFinder.find_spec = find
sys.argv = ["vsnbench", *sys.argv[2:]]
from vsnbench.cli.main import main
main()
"""

MISSING = [
    ("viewer", "rerun,rerun_bindings,rerun_cli", "view 1"),
    ("neural", "torch", "models check vlv --weights none.torch"),
    ("postgresql", "psycopg", "episodes list --db postgresql+psycopg://user@127.0.0.1/none"),
    ("bags", "rosbags", "export bag 1 -o episode.bag"),
    ("video", "av", "export video 1"),
    ("lerobot", "pyarrow", "export lerobot -o dataset"),
    ("ray", "ray", "run --model random --goal chair --workers ray://127.0.0.1:10001"),
    ("scan", "trimesh", "sites scan none.glb lab.yaml"),
    ("ros2", "rclpy,rpyutils", "robots simulate turtlebot4"),
]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record with an episode, made without any extra."""
    directory = tmp_path_factory.mktemp("core") / "results"
    hidden = "rerun,rerun_bindings,torch,onnx,onnxruntime,psycopg,rosbags,ray,rclpy,pyarrow"
    line = "run --model random --goal chair --starts 1 --max-steps 2 --quiet --json"
    done = without(hidden, line, directory)
    assert (done.returncode, done.stderr) == (0, "")
    assert not list(directory.glob("**/*.rrd")), "the copy for Rerun is created where Rerun is installed"
    return directory


def without(hidden: str, line: str, results: Path) -> "subprocess.CompletedProcess[str]":
    words = [
        sys.executable,
        "-c",
        WITHOUT,
        hidden,
        *line.split(),
        *([] if "ros2" in line else ["--results", str(results)]),
    ]
    if any(verb in line for verb in ("models check", "--db", "robots", "sites scan")):
        words = words[:-2]
    return subprocess.run(words, cwd=results.parent, capture_output=True, text=True, timeout=200)


@pytest.mark.parametrize(("extra", "hidden", "line"), MISSING, ids=lambda part: part.split()[0])
def test_a_verb_says_which_extra_it_wants(extra: str, hidden: str, line: str, results: Path) -> None:
    answer = without(hidden, line, results)
    assert answer.returncode in (1, 2), answer
    (said,) = answer.stderr.splitlines()
    assert said.startswith("vsnbench: error: ")
    assert command_to_add(extra) in said


def test_every_extra_for_users_has_a_verb_here() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    assert {extra for extra, _, _ in MISSING} == set(extras) - {"docs", "dev"}
