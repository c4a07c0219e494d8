"""Runs the command line in this process, or in a separate one that a test can kill."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import pytest

from vsnbench.cli.main import main
from vsnbench.runner.executors import capacity, process


@dataclass(frozen=True)
class Answer:
    """Output and exit code of a command."""

    code: int
    out: str
    err: str


def vsnbench(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: str) -> Answer:
    """Run a command in this process, and restore the environment, which a configuration file changes.

    The automatic number of workers is 1, because each worker and each fork server imports for a second.
    """
    monkeypatch.setattr(sys, "argv", ["vsnbench", *words])
    for module in (capacity, process):
        monkeypatch.setattr(module, "granted_cores", lambda: 1)
    capsys.readouterr()
    environment, code = dict(os.environ), 0
    try:
        main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        os.environ.clear()
        os.environ.update(environment)
    captured = capsys.readouterr()
    return Answer(code, captured.out, captured.err)


Typed = Callable[..., Answer]
"""What the fixture `typed` returns: it runs `vsnbench` with some arguments in this process."""


@contextmanager
def vsnbench_process(words: Sequence[str]) -> Iterator["subprocess.Popen[str]"]:
    """Start a command in a separate process, which ends with the block."""
    process = subprocess.Popen(
        [sys.executable, "-m", "vsnbench.cli.main", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"COLUMNS": "200"},
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for stream in (process.stdout, process.stderr):
            if stream:
                stream.close()
