"""A model that never returns from `close` costs neither results nor the terminal."""

import subprocess
import sys

import pytest

PROGRAM = """
import sys, time
from tests.runner.stand_ins import ScriptedPolicy
from vsnbench.runner.setup import trial_setup

class Stuck(ScriptedPolicy):
    def close(self):
        {close}

trial_setup.CLOSE_TIMEOUT_S, trial_setup.CLOSE_GRACE_S = 0.2, 0.5
trial_setup.close_policy(Stuck([]))
print("the run goes on")
"""
SLEEPS = "time.sleep(60)"
CATCHES_ALL = """while True:
            try:
                time.sleep(60)
            except BaseException:
                pass"""


@pytest.mark.parametrize(
    ("close", "code", "out", "err"),
    [
        ("sys.exit(0)", 0, "the run goes on\n", "failed in close: SystemExit: 0"),
        (SLEEPS, 0, "the run goes on\n", "failed in close: TimeLimitError: not finished within 0.2 s"),
        (CATCHES_ALL, 1, "", "a model does not return from close"),
    ],
)
def test_a_model_that_hangs_in_close_is_interrupted_or_ended(close: str, code: int, out: str, err: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(close=close)], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout) == (code, out)
    assert err in done.stderr
