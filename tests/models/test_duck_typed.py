"""Models without the base class, as version 0.1 allowed, work with a warning."""

import subprocess
import sys
from pathlib import Path

MODEL = """
from vsnbench.models.contract import ModelCard
from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Decision

class Old:
    card = ModelCard("old")
    def reset(self, goal, seed): ...
    def act(self, observation): return Decision(Action.STOP)
"""


def test_the_command_line_shows_what_to_change_and_where(tmp_path: Path) -> None:
    (tmp_path / "older.py").write_text(MODEL)
    command = [sys.executable, "-m", "vsnbench.cli.main", "models", "check", "older:Old"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "older.py:3: DeprecationWarning" in done.stderr
    assert "`from vsnbench import Action`" in done.stderr
    assert "older.py:6: DeprecationWarning: write `class Old(vsnbench.Policy)`" in done.stderr
