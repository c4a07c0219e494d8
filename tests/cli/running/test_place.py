"""`vsnbench place`: the offset from a mark, as text, as JSON and as exit code."""

import json
from pathlib import Path

import pytest

from tests.cli.console import Typed

SMALL = ("place", "--robot", "simulated:turtlebot2@160x120")


def test_an_ambiguous_look_suggests_the_next_command_which_determines_the_pose(
    typed: Typed, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    looked = typed(*SMALL, "--start", "1")
    assert (looked.code, looked.out.splitlines()[0]) == (1, "not determined: left-right")
    assert looked.out.splitlines()[-1] == "next: the same command with --turn"
    turned = typed(*SMALL, "--start", "1", "--turn", "--json", "--picture", "seen.png")
    said = json.loads(turned.out)
    assert (said["determined"], said["method"], turned.code) == (True, "turn", int(not said["within_tolerance"]))
    assert Path("seen.png").read_bytes()[1:4] == b"PNG"
    assert [path.name for path in tmp_path.iterdir()] == ["seen.png"], "no record is made"
