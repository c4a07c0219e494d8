"""Markers for slow tests, and fixtures that all tests share."""

import gc
import os
import re
import signal
from collections.abc import Generator
from pathlib import Path

import pytest
from hypothesis import settings

from tests.long_tests import LONG
from tests.slow_tests import SLOW

HERE = Path(__file__).parent

settings.register_profile("same", derandomize=True, deadline=None, max_examples=40)
"""Derandomized: every run generates the same examples. Without a deadline, because a busy machine would miss it."""
settings.register_profile("new", deadline=None)
"""New examples, and more: `HYPOTHESIS_PROFILE=new`, as `make test-long` does."""
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))

LONGEST = (
    "docs/test_commands.py",
    "training/test_run.py",
    "golden/test_golden.py",
    "fuzz/test_fuzz.py",
    "web/results_browser/test_page_in_browser.py",
    "web/results_browser/test_website.py",
    "web/second_judgement/test_second_judgement_app.py",
    "web/operator/test_page_in_browser.py",
    "results/schema/test_migrate.py",
    "cli/running/test_try.py",
    "web/operator/test_page.py",
    "web/driver/test_driver_page.py",
    "web/site_editor/test_editor.py",
    "web/site_editor/test_scan.py",
    "cli/study/test_verbs.py",
    "runner/executors/test_local_pool.py",
    "cli/running/test_run_with_a_person.py",
    "cli/running/test_run.py",
    "cli/test_hostile_archive.py",
    "report/test_figure_layout.py",
    "report/test_page.py",
    "localization/test_matching.py",
    "cli/results/test_view.py",
    "examples/test_adapters.py",
    "robots/test_ros1.py",
    "robots/test_ros1_run.py",
    "robots/test_ros1_drive.py",
    "robots/test_ros1_driving_on.py",
    "ros/ros1/test_discrete_move.py",
    "cli/robots/test_doctor.py",
    "robots/test_ros1_network.py",
    "robots/test_calibration.py",
    "ros/ros2/test_drive.py",
    "ros/ros2/test_driving_on.py",
    "ros/ros2/test_faults.py",
    "ros/ros2/test_doctor.py",
    "ros/ros2/test_camera_faults.py",
    "ros/ros2/test_hazard_topics.py",
    "cli/robots/test_doctor_hazards.py",
    "robots/test_ros1_camera_faults.py",
)
"""Files that start first, in this order: a long file that starts last leaves the other workers idle, and files that
mostly wait for a browser leave the cores idle if they run together, as they do at the end of the alphabet.
"""

_MARK = re.compile(r"\bmark\.(\w+)")
_MARKS_OF_FILE = re.compile(r"^pytestmark = .*", re.MULTILINE)

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell starts background jobs of a script so, and every process of a test would inherit it: `exec` keeps an
    # ignored signal, and resets a handler to the default.
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:  # nohup; vsnbench leaves it ignored, and tests send it
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Disable garbage collection during collection and freeze its objects: a full collection takes 0.4 s.

    Tests collect more rarely than Python by default, which takes a tenth of their processor time.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.set_threshold(50_000, 20, 20)
        gc.enable()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Skip a file if its marks exclude all its tests: importing all files takes 10 s per worker."""
    marks: str = config.getoption("markexpr")
    excluded = set(re.findall(r"not (\w+)", marks))
    if "slow" in excluded and _place(collection_path) in SLOW:
        return True
    if collection_path.suffix != ".py":
        return None
    text = collection_path.read_text(encoding="utf-8")
    if excluded & {mark for line in _MARKS_OF_FILE.findall(text) for mark in _MARK.findall(line)}:
        return True
    lane = marks.partition(" ")[0]
    named = lane == "long" and any(key.partition("::")[0] == _place(collection_path) for key in LONG)
    return (lane in ("ros", "ros2", "long") and lane not in _MARK.findall(text) and not named) or None


def _place(path: Path) -> str:
    return path.relative_to(HERE).as_posix() if path.is_relative_to(HERE) else path.as_posix()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark long and slow tests and tests that start a PostgreSQL server, and put the longest files first."""
    files = {*LONGEST, *(key.partition("::")[0] for key in (*LONG, *SLOW))}
    if gone := sorted(name for name in files if not (HERE / name).is_file()):
        raise pytest.UsageError(f"tests/conftest.py or its lists name files that do not exist: {', '.join(gone)}")
    for item in items:
        place = _place(item.path)
        test = f"{place}::{getattr(item, 'originalname', item.name)}"
        if LONG.keys() & {place, test, f"{place}::{item.name}"}:
            item.add_marker(pytest.mark.long)
        if SLOW & {place, test}:
            item.add_marker(pytest.mark.slow)
        chosen = str(getattr(getattr(item, "callspec", None), "params", {}))
        if "postgresql" in getattr(item, "fixturenames", ()) or "postgresql" in chosen:
            item.add_marker(pytest.mark.postgresql)
    order = {HERE / name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: order.get(item.path, len(order)))
