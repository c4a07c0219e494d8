"""`vsnbench judge --second`: answers by number, refusals, and the page."""

import json
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_record_verbs import vsnbench
from tests.web.second_judgement.blind_record import TELLTALE, entered, first_success, make_record


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """40 episodes that a first person has judged."""
    directory = tmp_path_factory.mktemp("made") / "results"
    make_record(directory)
    return directory


@pytest.fixture
def results(made: Path, tmp_path: Path) -> Path:
    """A copy of the record for one test."""
    return shutil.copytree(made, tmp_path / "results")


def test_answers_by_number_are_reported_with_their_differences(results: Path) -> None:
    assert vsnbench(results, "report", "--format", "json").stdout.count('"second_judgements": []') == 1
    for number in range(1, 9):
        success = first_success(number) if number != 2 else False
        done = vsnbench(results, "judge", str(number), "--second", "Grace", "--distance", "0.5" if success else "3")
        assert done.returncode == 0, done.stderr
        assert not [text for text in TELLTALE if text in done.stdout + done.stderr]
    answer = vsnbench(results, "judge", "8", "--second", "grace", "--void", "a visitor", "--json")
    assert json.loads(answer.stdout) == {"id": 8, "rater": "grace", "outcome": "void", "text": "void: a visitor"}
    (rater,) = json.loads(vsnbench(results, "report", "--format", "json").stdout)["second_judgements"]
    assert (rater["episodes"], rater["same"]) == (8, 6 / 8)
    differing = [(found["episode"], found["first"], found["second"]) for found in rater["differing"]]
    assert differing == [(2, "success", "failure"), (8, "success", "void")]
    table = vsnbench(results, "report").stdout
    assert "Blind second judgements" in table
    assert "Episodes judged differently" in table
    assert json.loads(vsnbench(results, "episodes", "show", "2", "--json").stdout)["success"] is True


def test_a_retracted_answer_does_not_count(results: Path) -> None:
    for words in (("--distance", "3"), ("--retract",)):
        assert vsnbench(results, "judge", "1", "--second", "Grace", *words).returncode == 0
    assert vsnbench(results, "judge", "1", "--second", "Grace", "--retract").returncode == 2
    assert json.loads(vsnbench(results, "report", "--format", "json").stdout)["second_judgements"] == []


def test_the_page_is_served_until_ctrl_c(results: Path) -> None:
    command = [sys.executable, "-m", "vsnbench.cli.main", "judge", "--second", "Grace", "--sample", "3"]
    process = subprocess.Popen(
        [*command, "--port", "0", "--results", str(results)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        state = entered(process.stdout.readline().strip()).ask("GET", "/state").json
        assert (state["rater"], state["total"], state["answers"]) == ("Grace", 3, [])
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert re.findall(r"(\d of \d) episodes", err) == ["0 of 3", "0 of 3"]
    assert not [text for text in (*TELLTALE, "Traceback") if text in out + err]
    assert process.returncode == 0
