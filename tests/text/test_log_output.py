"""--verbose, --log-file and their environment variables."""

import logging
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.console import vsnbench
from vsnbench.errors import UsageError
from vsnbench.text.log_output import FILE_VARIABLE, LEVEL_VARIABLE, log_more, opened_log, without_log_on_stderr

LINE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z (DEBUG|INFO|WARNING|ERROR) \[\d+\] [\w.]+: .+")
logger = logging.getLogger("vsnbench.somewhere")


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for variable in (LEVEL_VARIABLE, FILE_VARIABLE):
        monkeypatch.setenv(variable, "")
    yield
    assert logging.getLogger("vsnbench").level == logging.NOTSET


@pytest.mark.parametrize(("verbosity", "shown"), [(0, "WARNING"), (1, "INFO WARNING"), (2, "DEBUG INFO WARNING")])
def test_verbose_adds_levels_on_stderr_and_the_file_has_info(
    verbosity: int, shown: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with opened_log():
        log_more(verbosity, tmp_path / "log")
        for level in (logging.DEBUG, logging.INFO, logging.WARNING):
            logger.log(level, "a message")
        with without_log_on_stderr():
            logger.error("only in the file")
    assert re.findall("vsnbench: ([A-Z]+): a message", capsys.readouterr().err) == shown.split()
    lines = (tmp_path / "log").read_text(encoding="utf-8").splitlines()
    assert all(map(LINE.fullmatch, lines)), lines
    levels = [line.split()[1] for line in lines]
    assert levels == (["DEBUG"] if verbosity == 2 else []) + ["INFO", "WARNING", "ERROR"]


def test_control_characters_in_messages_are_visible_in_the_file(tmp_path: Path) -> None:
    with opened_log():
        log_more(0, tmp_path / "log")
        logger.warning("red \x1b[31m")
    assert "\x1b" not in (tmp_path / "log").read_text(encoding="utf-8")


def test_a_file_that_cannot_be_written_is_a_usage_error(tmp_path: Path) -> None:
    with opened_log(), pytest.raises(UsageError) as refused:
        log_more(0, tmp_path / "missing" / "log")
    assert refused.value.code == "log-file"


@pytest.mark.parametrize("words", [("--log-file", "log", "config", "show"), ("config", "show", "--log-file", "log")])
def test_the_option_goes_before_or_after_the_command_and_a_second_command_appends(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert vsnbench(monkeypatch, capsys, *words).code == 0
    refused = vsnbench(monkeypatch, capsys, "sites", "show", "nowhere", "--log-file", "log", "--quiet")
    assert refused.err.count("\n") == 1
    first, ended, second, error = (tmp_path / "log").read_text(encoding="utf-8").splitlines()
    assert ": config show --log-file log" in first or ": --log-file log config show" in first
    assert ended.endswith("exit code 0")
    assert "sites show nowhere" in second
    assert re.search(r" ERROR .*nowhere.* \(code unknown-site, exit code 2\)", error)


def test_worker_processes_log_to_the_same_file(tmp_path: Path) -> None:
    words = "run --model forward --goal chair --starts 1-2 --max-steps 1 --workers 2 --keep none -q --log-file log"
    subprocess.run([sys.executable, "-m", "vsnbench", *words.split()], cwd=tmp_path, check=True, timeout=200)
    lines = (tmp_path / "log").read_text(encoding="utf-8").splitlines()
    assert all(map(LINE.fullmatch, lines)), lines
    processes = {line.split()[2] for line in lines if "ended after 1 action:" in line}
    assert processes
    assert lines[0].split()[2] not in processes


def test_an_unknown_level_and_a_contradiction_are_usage_errors(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert vsnbench(monkeypatch, capsys, "config", "show", "-q", "-v").code == 2
    monkeypatch.setenv(LEVEL_VARIABLE, "loud")
    answer = vsnbench(monkeypatch, capsys, "config", "show")
    assert answer.code == 2
    assert "debug, info, warning, error" in answer.err


def test_a_log_file_with_the_name_of_a_command_is_not_that_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert vsnbench(monkeypatch, capsys, "--log-file", "run", "config", "show").code == 0
    assert (tmp_path / "run").is_file()
