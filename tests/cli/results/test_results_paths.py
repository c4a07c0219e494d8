"""Results directories with unusual names."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.console import Typed
from tests.web.results_browser.served_record import make_record


@pytest.mark.parametrize("option", [("--results", "./-dash"), ("--results=./-dash",)])
def test_a_name_that_begins_with_a_dash_is_written_with_its_directory(
    typed: Typed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, option: tuple[str, ...]
) -> None:
    make_record(tmp_path / "-dash")
    monkeypatch.chdir(tmp_path)
    answer = typed("db", "path", *option)
    assert (answer.code, answer.out.strip()) == (0, str(tmp_path / "-dash" / "vsnbench.db"))
    refused = typed("db", "path", "--results", "-dash")
    assert refused.code == 2
    assert "./-name" in refused.err


@pytest.mark.parametrize("words", [(b"episodes", b"list", b"--results"), (b"verify",)], ids=repr)
def test_a_path_that_is_not_utf8_is_refused_in_one_line(tmp_path: Path, words: tuple[bytes, ...]) -> None:
    make_record(tmp_path / "record")
    path = os.fsencode(tmp_path) + b"/r\xff"
    (tmp_path / "record").rename(os.fsdecode(path))
    done = subprocess.run(
        [os.fsencode(sys.executable), b"-m", b"vsnbench.cli.main", *words, path],
        stderr=subprocess.PIPE,
        timeout=60,
        check=False,
    )
    assert done.returncode in (1, 2)
    assert done.stderr.count(b"\n") == 1
    assert b"not valid UTF-8" in done.stderr
