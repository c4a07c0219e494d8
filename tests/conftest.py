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

HERE = Path(__file__).parent

settings.register_profile("same", derandomize=True, deadline=None, max_examples=40)
"""Derandomized: every run generates the same examples. Without a deadline, because a busy machine would miss it."""
settings.register_profile("new", deadline=None)
"""New examples, and more: `HYPOTHESIS_PROFILE=new`, as `make test-long` does."""
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))

SLOW = frozenset(
    {
        "cli/evidence/test_verify.py",
        "cli/judging/test_judge.py",
        "cli/judging/test_second_judge.py",
        "cli/models/test_fetching.py",
        "cli/models/test_models.py",
        "cli/results/test_export_video.py",
        "cli/results/test_read_only.py",
        "cli/results/test_report.py",
        "cli/results/test_view.py",
        "cli/robots/test_doctor.py",
        "cli/running/test_place.py",
        "cli/running/test_run.py",
        "cli/running/test_run_cropped.py",
        "cli/running/test_run_keeping.py",
        "cli/running/test_run_pirlnav.py",
        "cli/running/test_run_with_a_person.py",
        "cli/running/test_stress.py",
        "cli/study/test_verbs.py",
        "cli/support/test_completion.py",
        "cli/test_hostile_archive.py",
        "cli/test_protocol.py",
        "cli/test_record_verbs.py",
        "cli/test_sites.py",
        "cli/test_sweep.py",
        "evidence/bundle/test_make.py",
        "evidence/verification/test_hostile_records.py",
        "evidence/verification/test_older_records.py",
        "evidence/verification/test_verify.py",
        "examples/test_adapters.py",
        "examples/test_examples.py",
        "examples/test_frontier.py",
        "examples/test_node_policy.py",
        "examples/test_point_robot.py",
        "files/test_disk_cache.py",
        "golden/test_golden.py",
        "interop/lerobot/test_dataset.py",
        "interop/test_killed_merge.py",
        "interop/test_mcap_file.py",
        "interop/test_merge.py",
        "interop/test_merge_files.py",
        "interop/test_ros_map.py",
        "localization/test_differences.py",
        "localization/test_matching.py",
        "models/baselines/test_oracle.py",
        "models/pirlnav/test_checkpoint.py",
        "models/pirlnav/test_hostile_checkpoints.py",
        "models/pirlnav/test_parity.py",
        "models/pirlnav/test_policy.py",
        "models/remote/test_fuzz.py",
        "models/remote/test_policy.py",
        "models/remote/test_serving.py",
        "models/remote/test_sessions.py",
        "models/remote/test_versions.py",
        "models/remote/test_websockets_versions.py",
        "models/test_contract_check.py",
        "models/test_identity.py",
        "models/vlv/test_map_against_site.py",
        "models/vlv/test_mask_rcnn.py",
        "models/vlv/test_planner.py",
        "models/vlv/test_policy.py",
        "models/vlv/value/test_network.py",
        "protocol/test_goal_distance.py",
        "report/analysis/test_courses.py",
        "report/analysis/test_failure_places.py",
        "report/analysis/test_sensitivity.py",
        "report/analysis/test_summary.py",
        "report/comparison/test_compare.py",
        "report/comparison/test_question.py",
        "report/comparison/test_stress.py",
        "report/test_figure_layout.py",
        "report/test_figures.py",
        "report/test_forms.py",
        "report/test_page.py",
        "results/merging/test_studies.py",
        "results/reading/test_queries.py",
        "results/schema/test_guard.py",
        "results/schema/test_migrate.py",
        "results/studies/test_log.py",
        "results/test_goals.py",
        "results/test_record_of_0001.py",
        "robots/test_simulated.py",
        "ros/ros1/test_installation.py",
        "runner/disturbances/test_policy_view.py",
        "runner/episode/test_bad_answers.py",
        "runner/episode/test_interrupted_motion.py",
        "runner/executors/test_collecting.py",
        "runner/executors/test_local_pool.py",
        "runner/executors/test_served_workers.py",
        "runner/judging/test_faces.py",
        "runner/setup/test_trial_setup.py",
        "runner/stopping/test_requests.py",
        "runner/study/test_integrity.py",
        "runtime/test_numba_cache.py",
        "sensing/test_difficult_bases.py",
        "sensing/test_mover.py",
        "simulator/generated_sites/test_generate.py",
        "simulator/rendering/test_renderer.py",
        "site_checks/test_check.py",
        "site_checks/test_mistakes.py",
        "statistics/test_agreement.py",
        "statistics/test_power_independent.py",
        "test_releases.py",
        "text/test_log_output.py",
        "viewer/test_pair.py",
        "viewer/test_rebuild.py",
        "web/operator/test_page.py",
        "web/results_browser/test_app.py",
        "web/results_browser/test_website.py",
        "web/second_judgement/test_second_judgement_app.py",
        "web/second_judgement/test_second_judgement_in_browser.py",
    }
)
"""Files whose tests take more than 3 s of processor time, or 10 s with waiting; of each package, some stay quick.
A single slow test of a quick file has the mark itself."""

SLOW_FOLDERS = frozenset({"fuzz", "training"})

LONGEST = (
    "docs/test_commands.py",
    "training/test_run.py",
    "fuzz/test_fuzz.py",
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
    "ros/ros2/test_run.py",
    "ros/ros2/test_camera_faults.py",
    "ros/ros2/test_hazard_topics.py",
    "cli/robots/test_doctor_hazards.py",
    "robots/test_ros1_camera_faults.py",
)
"""Files that start first, in this order: a long file that starts last leaves the other workers idle."""

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
    if "slow" in excluded and _is_slow(collection_path):
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


def _is_slow(path: Path) -> bool:
    place = _place(path)
    return place in SLOW or place.partition("/")[0] in SLOW_FOLDERS


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark long and slow tests and tests that start a PostgreSQL server, and put the longest files first."""
    files = {key.partition("::")[0] for key in LONG}
    if gone := sorted(name for name in {*SLOW, *LONGEST, *files} if not (HERE / name).is_file()):
        raise pytest.UsageError(f"tests/conftest.py or long_tests.py lists files that do not exist: {', '.join(gone)}")
    for item in items:
        place = _place(item.path)
        test = f"{place}::{getattr(item, 'originalname', item.name)}"
        if LONG.keys() & {place, test, f"{place}::{item.name}"}:
            item.add_marker(pytest.mark.long)
        if _is_slow(item.path):
            item.add_marker(pytest.mark.slow)
        chosen = str(getattr(getattr(item, "callspec", None), "params", {}))
        if "postgresql" in getattr(item, "fixturenames", ()) or "postgresql" in chosen:
            item.add_marker(pytest.mark.postgresql)
    order = {HERE / name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: order.get(item.path, len(order)))
