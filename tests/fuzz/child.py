"""Child process that runs a target's inputs: `python -m tests.fuzz.child TARGET SEED FIRST END`."""

import contextlib
import io
import json
import os
import random
import resource
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from tests.fuzz.harness import MEMORY_LIMIT_BYTES
from tests.fuzz.targets import TARGETS
from vsnbench.errors import VsnbenchError


def main(name: str, seed: int, first: int, end: int) -> None:
    """Run the inputs `first` to `end - 1`."""
    report = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # output of libraries must not mix with the report
    target = TARGETS[name]
    home = Path.cwd() / "target"
    home.mkdir()
    with quiet():
        instance = target(home)
        instance.load(random.Random(0), None)
    resource.setrlimit(resource.RLIMIT_DATA, (data_bytes() + MEMORY_LIMIT_BYTES, resource.RLIM_INFINITY))
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(json.dumps({"ready": True}), file=report)
    for index in range(first, end):
        rng = random.Random(f"{name}/{seed}/{index}")
        began = time.monotonic()
        finding, outcome = "", "accepted"
        try:
            with quiet() as stderr:
                instance.load(rng, index)
            if "Traceback (most recent call last)" in stderr.getvalue():
                finding = f"a traceback on stderr: {stderr.getvalue()[-500:]}"
        except VsnbenchError as error:
            outcome = type(error).__name__
        except BaseException as error:
            outcome = type(error).__name__
            where = traceback.extract_tb(error.__traceback__)[-4:]
            trace = " < ".join(f"{Path(frame.filename).name}:{frame.lineno}" for frame in reversed(where))
            finding = f"{outcome}: {str(error)[:200]!r} at {trace}"
        result: dict[str, Any] = {"index": index, "end": outcome, "finding": finding, "s": time.monotonic() - began}
        grown_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kib
        print(json.dumps(result | {"grown_mib": grown_kib / 1024}), file=report)


@contextlib.contextmanager
def quiet() -> Any:
    """Capture the output."""
    stderr = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(stderr):
        yield stderr


def data_bytes() -> int:
    """Return the current memory that counts towards RLIMIT_DATA."""
    (line,) = [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmData")]
    return int(line.split()[1]) * 1024


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
