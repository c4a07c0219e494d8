"""Runs a loader's inputs in a child process with bounded memory, and records findings.

A finding is an exception other than `VsnbenchError`, a crash, an input that takes more than `TIME_LIMIT_S` of processor
time or `WAIT_LIMIT_S` of any time (on a busy machine a process may wait for seconds), or memory beyond
`MEMORY_LIMIT_BYTES`. An input is a pure function of (target, seed, index), so findings are reproducible.
"""

import json
import os
import select
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import psutil

TIME_LIMIT_S: Final = 20.0
WAIT_LIMIT_S: Final = 180.0
START_LIMIT_S: Final = 120.0
MEMORY_LIMIT_BYTES: Final = 2**30
ROOT: Final = Path(__file__).resolve().parents[2]


@dataclass
class Outcome:
    """What became of the inputs of one target."""

    target: str
    inputs: int = 0
    ends: Counter[str] = field(default_factory=Counter)
    """`accepted`, or the name of the error that refused it."""
    findings: list[str] = field(default_factory=list)
    worst_s: float = 0.0
    worst_mib: float = 0.0
    """The most that the child grew over what it had before the first input."""


def run(target: str, seed: int, count: int, first: int = 0) -> Outcome:
    """Feed a target `count` inputs, one child after the other where one dies."""
    outcome = Outcome(target)
    index, end = first, first + count
    while index < end:
        index = _one_child(outcome, seed, index, end)
    return outcome


class _Limit:
    """The time that a child has for an input."""

    def __init__(self, pid: int, time_s: float) -> None:
        self._process = psutil.Process(pid)
        self._processor_s = self._used_s() + time_s
        self._deadline_s = time.monotonic() + WAIT_LIMIT_S

    def is_exceeded(self) -> bool:
        return self._used_s() > self._processor_s or time.monotonic() > self._deadline_s

    def _used_s(self) -> float:
        try:
            return sum(self._process.cpu_times()[:2])
        except psutil.Error:  # it has just ended, which its pipe shows
            return 0.0


def _one_child(outcome: Outcome, seed: int, index: int, end: int) -> int:
    """Run inputs until all are done or the child is; return the next index."""
    words = [sys.executable, "-m", "tests.fuzz.child", outcome.target, str(seed), str(index), str(end)]
    with tempfile.TemporaryDirectory(prefix="vsnbench-fuzz-") as folder, tempfile.TemporaryFile() as said:
        environment = os.environ | {"TMPDIR": folder, "HOME": folder, "PYTHONPATH": str(ROOT), "NO_COLOR": "1"}
        child = subprocess.Popen(words, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=said)
        assert child.stdout is not None
        try:
            limit_s = START_LIMIT_S
            buffer = b""
            while True:
                limit = _Limit(child.pid, limit_s)
                while b"\n" not in buffer:
                    ready, _, _ = select.select([child.stdout], [], [], 0.2)
                    if not ready and not limit.is_exceeded():
                        continue
                    if not ready:
                        outcome.inputs += 1
                        outcome.findings.append(f"seed {seed} input {index}: no end within {limit_s:g} s")
                        return index + 1
                    part = os.read(child.stdout.fileno(), 65536)
                    if not part:
                        if limit_s == START_LIMIT_S:
                            said.seek(0)
                            raise RuntimeError(
                                f"{outcome.target}: refuses its good input: {said.read()[-3000:].decode()}"
                            )
                        if index < end:
                            said.seek(0)
                            last = said.read()[-600:].decode(errors="replace")
                            outcome.inputs += 1
                            outcome.findings.append(f"seed {seed} input {index}: died with {child.wait()}: {last}")
                        return index + 1
                    buffer += part
                line, _, buffer = buffer.partition(b"\n")
                limit_s = TIME_LIMIT_S
                told = json.loads(line)
                if told.get("ready"):
                    continue
                outcome.inputs += 1
                outcome.ends[told["end"]] += 1
                outcome.worst_s = max(outcome.worst_s, told["s"])
                outcome.worst_mib = max(outcome.worst_mib, told["grown_mib"])
                if told["finding"]:
                    outcome.findings.append(f"seed {seed} input {told['index']}: {told['finding']}")
                index = told["index"] + 1
        finally:
            child.kill()
            child.wait()
            child.stdout.close()
