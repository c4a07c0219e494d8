"""Processes of tests with output files, ended after the test; polling instead of sleeping."""

import os
import signal
import subprocess
import sys
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn, TextIO

import psutil
import pytest

PATIENCE_S = 60.0
"""Longest wait for what takes seconds on an idle machine; only a failing test waits that long."""


def wait_until(condition: Callable[[], object], what: str, patience_s: float = PATIENCE_S) -> None:
    """Poll until `condition()` is true; fail the test if it stays false."""
    give_up_s = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() > give_up_s:
            pytest.fail(f"not within {patience_s:g} s: {what}")
        time.sleep(0.02)


def has_ended(process: psutil.Process) -> bool:
    """Return whether a process has ended, reaped by its parent or not."""
    try:
        return not process.is_running() or process.status() in (psutil.STATUS_ZOMBIE, psutil.STATUS_DEAD)
    except psutil.NoSuchProcess:
        return True


@dataclass
class Process:
    """A process of a test with its output in a file."""

    popen: subprocess.Popen[bytes]
    log: Path

    @property
    def output(self) -> str:
        return self.log.read_text(errors="replace")

    def signal(self, number: signal.Signals) -> None:
        self.popen.send_signal(number)

    def wait(self, patience_s: float = PATIENCE_S) -> int:
        return self.popen.wait(patience_s)

    def end(self) -> None:
        if self.popen.poll() is None:
            self.popen.send_signal(signal.SIGCONT)
            self.popen.terminate()
            try:
                self.popen.wait(5)
            except subprocess.TimeoutExpired:
                self.popen.kill()
                self.popen.wait(5)
        if self.popen.stdin is not None:
            self.popen.stdin.close()


@dataclass
class ProcessGroup(ABC):
    """Processes that share an environment; they are ended together, and their output is printed."""

    directory: Path
    processes: list[Process] = field(default_factory=list, kw_only=True)

    @property
    @abstractmethod
    def environment(self) -> dict[str, str]:
        """Environment of the processes."""

    def launch(self, words: list[str], environment: dict[str, str], stdin: int = subprocess.DEVNULL) -> Process:
        """Start a program, with additional environment variables."""
        log = self.directory / f"{len(self.processes):02}.log"
        with log.open("wb") as sink:
            popen = subprocess.Popen(
                words, env=self.environment | environment, stdin=stdin, stdout=sink, stderr=subprocess.STDOUT
            )
        process = Process(popen, log)
        self.processes.append(process)
        return process

    def close(self) -> None:
        for process in reversed(self.processes):
            process.end()
        for process in self.processes:
            sys.stdout.write(f"--- {' '.join(map(str, process.popen.args))}\n{process.output}\n")


@dataclass(frozen=True)
class Fork:
    """A task in a fork of this process, which has imported everything already."""

    pid: int
    stdout: TextIO
    """What the task writes."""

    @classmethod
    def of(cls, task: Callable[[TextIO], object]) -> "Fork":
        """Start a task; it receives the file that `stdout` reads, and ends after a minute at the latest."""
        reads, writes = os.pipe()
        pid = os.fork()
        if pid == 0:
            _end_with(task, writes)
        os.close(writes)
        return cls(pid, os.fdopen(reads, encoding="utf-8"))

    def wait(self) -> int:
        """Return the exit code, negative for a signal."""
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])

    def kill(self) -> None:
        os.kill(self.pid, signal.SIGKILL)
        self.wait()


def _end_with(task: Callable[[TextIO], object], writes: int) -> NoReturn:
    """Run a task in the fork and end it without the exit handlers of the parent."""
    signal.signal(signal.SIGALRM, signal.SIG_DFL)  # of pytest's timeout
    signal.alarm(round(PATIENCE_S))
    code = 1
    try:
        with os.fdopen(writes, "w", encoding="utf-8") as sink:
            task(sink)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


class Conversation:
    """A Python file in a separate process, controlled by lines of JSON."""

    def __init__(self, words: list[str], environment: dict[str, str], errors: Any = None) -> None:
        self.popen = subprocess.Popen(
            words, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
        )

    def line(self) -> str:
        assert self.popen.stdout is not None
        return self.popen.stdout.readline()

    def tell(self, line: str) -> str:
        """Send a line and return the answering line."""
        assert self.popen.stdin is not None
        self.popen.stdin.write(f"{line}\n")
        self.popen.stdin.flush()
        return self.line()

    def close(self) -> None:
        self.popen.kill()
        self.popen.wait()
        for pipe in (self.popen.stdin, self.popen.stdout):
            if pipe is not None:
                pipe.close()
