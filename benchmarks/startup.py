"""Measures the time of `vsnbench --help` in ms, against importing Typer alone.

python benchmarks/startup.py
"""

import statistics
import subprocess
import sys
import time

RUNS = 15


def median_s(*words: str) -> float:
    """Return the median wall time of a command, seconds."""
    taken = []
    for _ in range(RUNS):
        began = time.perf_counter()
        subprocess.run([sys.executable, *words], capture_output=True, check=True)
        taken.append(time.perf_counter() - began)
    return statistics.median(taken)


def main() -> None:
    """Print both times and their ratio."""
    bare, ours = median_s("-c", "import typer"), median_s("-m", "vsnbench.cli.main", "--help")
    print(f"import typer      {bare * 1000:5.0f} ms")
    print(f"vsnbench --help   {ours * 1000:5.0f} ms  ({ours / bare:.2f} times)")


if __name__ == "__main__":
    main()
