"""Inner loops compile with or without a writable cache of machine code."""

import os
import subprocess
import sys
from pathlib import Path

PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
import loops
from vsnbench.simulator.rendering import raster
from vsnbench.simulator.rendering import light_rays
print(loops.double(21))
"""
LOOPS = """
from vsnbench.runtime.numba_cache import compiled

@compiled
def double(number):
    return 2 * number

@compiled
def triple(number):
    return 3 * number
"""


def run(folder: Path, home: str, temporary: str = "/tmp") -> "subprocess.CompletedProcess[str]":
    (folder / "loops.py").write_text(LOOPS, encoding="utf-8")
    environment = {
        name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")
    }
    return subprocess.run(
        [sys.executable, "-c", PROGRAM, str(folder)],
        env=environment | {"HOME": home, "TMPDIR": temporary},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_without_a_home_every_process_finds_what_the_first_has_compiled(tmp_path: Path) -> None:
    (tmp_path / "__pycache__").write_text("a file where the directory would be")
    kept = tmp_path / f"vsnbench-{os.getuid()}" / "compiled"
    first = run(tmp_path, "/dev/null", str(tmp_path))
    assert (first.stdout, first.stderr) == ("42\n", "")
    found = {file: file.stat().st_mtime_ns for file in kept.rglob("loops.double*.nb?")}
    assert found
    assert run(tmp_path, "/dev/null", str(tmp_path)).stdout == "42\n"
    assert {file: file.stat().st_mtime_ns for file in kept.rglob("loops.double*.nb?")} == found


def test_without_a_writable_directory_one_warning_is_logged(tmp_path: Path) -> None:
    (tmp_path / "__pycache__").write_text("a file where the directory would be")
    (tmp_path / f"vsnbench-{os.getuid()}").write_text("another one")
    done = run(tmp_path, "/dev/null", str(tmp_path))
    assert done.stdout == "42\n", done.stderr
    assert done.stderr.count("every process of a run compiles it again") == 1
    assert "NUMBA_CACHE_DIR" in done.stderr


def test_machine_code_is_cached_next_to_the_source(tmp_path: Path) -> None:
    done = run(tmp_path, str(tmp_path))
    assert (done.stdout, done.stderr) == ("42\n", "")
    assert list((tmp_path / "__pycache__").glob("loops.double*.nbi"))
