"""The three ways through the house are as short as docs/architecture.md says: a traced run and report tell."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent.parent


@pytest.mark.slow
def test_the_shortest_chains_of_hand_overs_are_those_of_the_drawing() -> None:
    script = HERE / "scripts" / "count_hops.py"
    done = subprocess.run([sys.executable, str(script)], cwd=HERE, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    drawing = (HERE / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert len(found) == 3
    for way, chain in found.items():
        line = next(line for line in drawing.splitlines() if line.startswith(f"| {way} "))
        assert re.findall(r"`([a-z0-9_/]+\.py)`", line) == chain
