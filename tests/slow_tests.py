"""The tests that `make check-fast` leaves to `make test`, by measured processor time: `slow_tests.txt`.

    python -m pytest -n 2 -p tests.slow_tests -m "not ros and not ros2 and not browser and not postgresql and not long"
    python -m tests.slow_tests

The first command writes the processor time of each test to the directory `$PROCESSOR_TIMES` (`.pytest_times` by
default), the second one the list. A function is slow if its cases together take `SLOW_S` or more. A line without a
function is a file of which all functions are slow: the fast tests do not even import it. The first test of a file pays
for a fixture that several share; run both commands again with "not slow and" to find the fast test that pays then.
"""

import os
import re
from collections import defaultdict
from collections.abc import Generator
from pathlib import Path

import pytest

HERE = Path(__file__).parent
LIST = HERE / "slow_tests.txt"
SLOW_S = 0.14
TIMES = Path(os.environ.get("PROCESSOR_TIMES", ".pytest_times"))

SLOW = frozenset(LIST.read_text(encoding="utf-8").split())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Write the processor time of a test with its fixtures, and of the processes that it waited for."""
    before = os.times()
    result = yield
    spent = sum(after - start for after, start in zip(os.times()[:4], before[:4], strict=True))
    TIMES.mkdir(exist_ok=True)
    worker = os.environ.get("PYTEST_XDIST_WORKER", "main")
    with (TIMES / f"{worker}.txt").open("a", encoding="utf-8") as file:
        file.write(f"{spent:.2f} {item.nodeid}\n")
    return result


def slow_tests(times: Path) -> list[str]:
    """Return the slow functions (`file::function`) and files in a directory of measured times."""
    cases: dict[str, float] = {}
    for file in times.glob("*.txt"):
        for line in file.read_text(encoding="utf-8").splitlines():
            spent, _, test = line.partition(" ")
            test = test.removeprefix("tests/")
            cases[test] = max(cases.get(test, 0.0), float(spent))
    functions: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    for test, spent_s in cases.items():
        file_name, _, function = test.partition("::")
        functions[file_name][re.sub(r"\[.*", "", function)] += spent_s
    slow = []
    for file_name, spent in functions.items():
        named = [f"{file_name}::{function}" for function, seconds in spent.items() if seconds >= SLOW_S]
        slow += [file_name] if len(named) == len(spent) else named
    return sorted(slow)


if __name__ == "__main__":
    LIST.write_text("\n".join(slow_tests(TIMES)) + "\n", encoding="utf-8")
