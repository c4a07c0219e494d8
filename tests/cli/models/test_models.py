"""`vsnbench models` on the command line: output, error lines and exit codes."""

import functools
import hashlib
import json
import os
import re
import subprocess
import sys
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
import torch

from vsnbench.cli.main import main

CHECKPOINT = Path(__file__).parents[2] / "data" / "pirlnav" / "ckpt.pth"


@pytest.fixture(autouse=True)
def own_directories(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "cache"))
    monkeypatch.setenv("VSNBENCH_WEIGHTS", str(tmp_path / "weights"))
    monkeypatch.setenv("COLUMNS", "120")
    torch.set_num_threads(1)


class QuietHandler(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


def vsnbench(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    """Run the command line in this process and return its exit code."""
    monkeypatch.setattr("sys.argv", ["vsnbench", *words])
    with pytest.raises(SystemExit) as left:
        main()
    return int(left.value.code or 0)


def test_the_list_names_every_model_and_what_it_can_look_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert vsnbench(monkeypatch, "models", "list") == 0
    out = capsys.readouterr().out
    assert "pirlnav" in out
    assert "monitor" in out
    assert "missing" in out
    assert vsnbench(monkeypatch, "models", "list", "--json") == 0
    by_name = {model["name"]: model for model in json.loads(capsys.readouterr().out)}
    assert by_name["random"]["goals"] is None
    assert by_name["pirlnav"]["goals"] == ["bed", "chair", "monitor", "plant", "sofa", "toilet"]
    assert by_name["pirlnav"]["sensors"] == ["rgb", "odometry"]


def test_showing_a_model_documents_every_setting(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    from vsnbench.models.pirlnav.settings import PIRLNavSettings

    assert vsnbench(monkeypatch, "models", "show", "pirlnav") == 0
    out = capsys.readouterr().out
    for setting in PIRLNavSettings.model_fields:
        assert setting in out
    assert str(tmp_path / "weights" / "pirlnav.ckpt") in out.replace("\n", "")


def test_a_default_of_one_is_shown_as_a_number(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert vsnbench(monkeypatch, "models", "show", "vlv") == 0
    out = capsys.readouterr().out
    assert re.search(r"novelty_weight +1\.0 ", out)
    assert re.search(r"scan_ends_on_goal +true ", out)


def test_only_what_the_command_line_has_is_shown_as_an_option(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert vsnbench(monkeypatch, "models", "show", "forward") == 0
    out = capsys.readouterr().out
    assert "--look-ahead-m" not in out
    assert "ForwardUntilBlocked(look_ahead_m=0.55, half_width_m=0.25)" in out
    assert vsnbench(monkeypatch, "models", "show", "pirlnav", "--json") == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["options"] == ["--weights", "--model-config", "--device"]
    assert shown["keywords"] == {"weights": "None", "model_config": "None", "device": "'auto'", "runtime": "None"}
    assert vsnbench(monkeypatch, "run", "--model", "forward", "--goal", "chair", "--weights", "x.pt") == 2
    error = capsys.readouterr().err
    assert "--weights" in error
    assert "look_ahead_m, half_width_m" in error


def test_a_default_with_markup_is_shown_as_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    method = 'def __init__(self, name="[/b] [m]"):\n        pass\n'
    (tmp_path / "marked.py").write_text(f"from vsnbench import Policy\nclass Marked(Policy):\n    {method}")
    monkeypatch.chdir(tmp_path)
    assert vsnbench(monkeypatch, "models", "show", "marked:Marked") == 0
    assert "Marked(name='[/b] [m]')" in capsys.readouterr().out


def test_a_check_says_what_is_in_the_weights_and_how_the_engines_compare(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert vsnbench(monkeypatch, "models", "check", "pirlnav", "--weights", str(CHECKPOINT), "--device", "cpu") == 0
    out = capsys.readouterr().out
    for expected in ("df429dd5ffb1d535", "582,927", "260,000,000", "agrees", "onnxruntime", "ms per step"):
        assert expected in out


def test_a_check_for_scripts(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert vsnbench(monkeypatch, "models", "check", "pirlnav", "-w", str(CHECKPOINT), "--device", "cpu", "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert report["parameters"] == 582_927
    assert report["critic"] is True
    assert report["training_steps"] == 260_000_000
    assert report["parity"]["agrees"] is True
    assert report["parity"]["largest_logit_difference"] < 1e-4
    assert [timing["median_ms"] > 0 for timing in report["timings"]] == [True, True]


SLOW_MODEL = """
import pathlib
from vsnbench import Action, Decision, ModelCard, Policy

class Slow(Policy):
    card = ModelCard("slow")

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        shown = pathlib.Path(__file__).with_name("out.txt").read_text()
        assert EXPECTED, f"printed before the first action: {shown!r}"
        print("printed by the model")
        return Decision(Action.TURN_LEFT)
"""


@pytest.mark.parametrize(("option", "expected"), [((), '"card " in shown'), (("--json",), "shown == ''")])
def test_a_check_prints_each_result_as_it_is_known_and_json_in_one_piece(
    option: tuple[str, ...], expected: str, tmp_path: Path
) -> None:
    (tmp_path / "slow.py").write_text(SLOW_MODEL.replace("EXPECTED", expected))
    command = [sys.executable, "-m", "vsnbench", "models", "check", "slow:Slow", *option]
    with (tmp_path / "out.txt").open("w") as out:
        ended = subprocess.run(
            command,
            stdout=out,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])},
        )
    shown = (tmp_path / "out.txt").read_text()
    assert ended.returncode == 0, shown + ended.stderr
    if option:
        assert [finding["what"] for finding in json.loads(shown)][:3] == ["card", "goals", "reset twice"]


def test_fetched_weights_are_found_by_the_check(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    handler = functools.partial(QuietHandler, directory=str(CHECKPOINT.parent))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as web:
        thread = threading.Thread(target=web.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        url = f"http://127.0.0.1:{web.server_port}/{CHECKPOINT.name}"
        sha256 = hashlib.sha256(CHECKPOINT.read_bytes()).hexdigest()
        try:
            assert vsnbench(monkeypatch, "models", "fetch", "pirlnav", url, "--sha256", sha256) == 0
        finally:
            web.shutdown()
            thread.join()
    fetched = capsys.readouterr()
    assert fetched.out == f"{tmp_path / 'weights' / 'pirlnav.ckpt'}\n"
    assert "next: vsnbench models check pirlnav" in fetched.err
    assert vsnbench(monkeypatch, "models", "check", "pirlnav", "--device", "cpu", "--json") == 0
    assert json.loads(capsys.readouterr().out)["sha256"] == sha256


def test_a_model_that_ends_its_process_fails_its_check(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert vsnbench(monkeypatch, "models", "check", "tests.cli.turning:Exiting", "--json") == 1
    findings = {finding["what"]: finding for finding in json.loads(capsys.readouterr().out)}
    assert not findings["same seed, same actions"]["passed"]
    assert "os._exit(0)" in findings["same seed, same actions"]["seen"]
