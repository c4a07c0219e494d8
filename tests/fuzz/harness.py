"""Runs a loader's inputs in a child process with bounded memory, and records findings.

A finding is an exception other than `VsnbenchError`, a crash, an input that takes more than `TIME_LIMIT_S`, or memory
beyond `MEMORY_LIMIT_BYTES`. An input is a pure function of (target, seed, index), so findings are reproducible.
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

TIME_LIMIT_S: Final = 20.0
START_LIMIT_S: Final = 120.0
MEMORY_LIMIT_BYTES: Final = 2**30
ROOT: Final = Path(__file__).resolve().parents[2]


@dataclass
class Outcome:
    """Results of the inputs of a target."""

    target: str
    inputs: int = 0
    ends: Counter[str] = field(default_factory=Counter)
    """`accepted`, or the name of the error that refused it."""
    findings: list[str] = field(default_factory=list)
    worst_s: float = 0.0
    worst_mib: float = 0.0
    """Largest growth of the child's memory since before the first input."""


def run(target: str, seed: int, count: int, first: int = 0) -> Outcome:
    """Run `count` inputs of a target, with a new child after each crash."""
    outcome = Outcome(target)
    index, end = first, first + count
    while index < end:
        index = _one_child(outcome, seed, index, end)
    return outcome


def _one_child(outcome: Outcome, seed: int, index: int, end: int) -> int:
    """Run inputs until all are done or the child ends; return the next index."""
    words = [sys.executable, "-m", "tests.fuzz.child", outcome.target, str(seed), str(index), str(end)]
    with tempfile.TemporaryDirectory(prefix="vsnbench-fuzz-") as folder, tempfile.TemporaryFile() as errors:
        environment = os.environ | {"TMPDIR": folder, "HOME": folder, "PYTHONPATH": str(ROOT), "NO_COLOR": "1"}
        child = subprocess.Popen(words, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=errors)
        assert child.stdout is not None
        try:
            limit_s = START_LIMIT_S
            buffer = b""
            while True:
                deadline = time.monotonic() + limit_s
                while b"\n" not in buffer:
                    ready, _, _ = select.select([child.stdout], [], [], max(deadline - time.monotonic(), 0))
                    if not ready:
                        outcome.inputs += 1
                        outcome.findings.append(f"seed {seed} input {index}: no end within {limit_s:g} s")
                        return index + 1
                    part = os.read(child.stdout.fileno(), 65536)
                    if not part:
                        if limit_s == START_LIMIT_S:
                            errors.seek(0)
                            raise RuntimeError(
                                f"{outcome.target}: refuses its good input: {errors.read()[-3000:].decode()}"
                            )
                        if index < end:
                            errors.seek(0)
                            last = errors.read()[-600:].decode(errors="replace")
                            outcome.inputs += 1
                            outcome.findings.append(f"seed {seed} input {index}: died with {child.wait()}: {last}")
                        return index + 1
                    buffer += part
                line, _, buffer = buffer.partition(b"\n")
                limit_s = TIME_LIMIT_S
                result = json.loads(line)
                if result.get("ready"):
                    continue
                outcome.inputs += 1
                outcome.ends[result["end"]] += 1
                outcome.worst_s = max(outcome.worst_s, result["s"])
                outcome.worst_mib = max(outcome.worst_mib, result["grown_mib"])
                if result["finding"]:
                    outcome.findings.append(f"seed {seed} input {result['index']}: {result['finding']}")
                index = result["index"] + 1
        finally:
            child.kill()
            child.wait()
            child.stdout.close()
