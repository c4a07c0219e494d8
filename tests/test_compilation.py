"""Inner loops are compiled with or without a place to keep the machine code."""

import os
import subprocess
import sys
from pathlib import Path

PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
import loops
from vsnbench.simulator import raster, light_rays
print(loops.double(21))
"""
LOOPS = """
from vsnbench.compilation import compiled

@compiled
def double(number):
    return 2 * number

@compiled
def triple(number):
    return 3 * number
"""


def run(folder: Path, home: str) -> "subprocess.CompletedProcess[str]":
    (folder / "loops.py").write_text(LOOPS, encoding="utf-8")
    environment = {
        name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")
    }
    return subprocess.run(
        [sys.executable, "-c", PROGRAM, str(folder)],
        env=environment | {"HOME": home},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_with_no_directory_to_write_it_runs_and_says_once_what_that_costs(tmp_path: Path) -> None:
    (tmp_path / "__pycache__").write_text("a file where the directory would be")
    done = run(tmp_path, "/dev/null")
    assert done.stdout == "42\n", done.stderr
    assert done.stderr.count("every start compiles it anew") == 1
    assert "NUMBA_CACHE_DIR" in done.stderr


def test_machine_code_is_kept_beside_the_source(tmp_path: Path) -> None:
    done = run(tmp_path, str(tmp_path))
    assert (done.stdout, done.stderr) == ("42\n", "")
    assert list((tmp_path / "__pycache__").glob("loops.double*.nbi"))
