"""Markers for slow tests, and fixtures that all tests share."""

import gc
import itertools
import os
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from sqlalchemy import Engine

    from vsnbench.results.schema.migrate import SchemaState

HERE = Path(__file__).parent

settings.register_profile("same", derandomize=True)
"""Derandomized: every run generates the same examples. `HYPOTHESIS_PROFILE=default` generates new ones."""
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))

SLOW = frozenset(
    {
        "bundle/test_make.py",
        "cli/judging/test_judge.py",
        "cli/judging/test_second_judge.py",
        "cli/evidence/test_verify.py",
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
        "cli/test_sites.py",
        "cli/test_sweep.py",
        "examples/test_adapters.py",
        "examples/test_frontier.py",
        "examples/test_point_robot.py",
        "files/test_disk_cache.py",
        "interop/lerobot/test_dataset.py",
        "interop/test_killed_merge.py",
        "interop/test_mcap_file.py",
        "interop/test_merge.py",
        "interop/test_merge_files.py",
        "localization/test_matching.py",
        "models/baselines/test_oracle.py",
        "models/pirlnav/test_checkpoint.py",
        "models/pirlnav/test_parity.py",
        "models/pirlnav/test_policy.py",
        "models/remote/test_fuzz.py",
        "models/remote/test_policy.py",
        "models/remote/test_serving.py",
        "models/remote/test_sessions.py",
        "models/remote/test_websockets_versions.py",
        "models/test_identity.py",
        "models/vlv/test_centernet.py",
        "models/vlv/test_map_against_site.py",
        "models/vlv/test_mask_rcnn.py",
        "models/vlv/test_planner.py",
        "models/vlv/test_policy.py",
        "models/vlv/value/test_network.py",
        "protocol/test_goal_distance.py",
        "report/analysis/test_courses.py",
        "report/analysis/test_failure_places.py",
        "report/comparison/test_compare.py",
        "report/test_figure_layout.py",
        "report/test_figures.py",
        "report/test_forms.py",
        "report/test_page.py",
        "results/schema/test_migrate.py",
        "results/test_goals.py",
        "results/test_record_of_0001.py",
        "robots/test_simulated.py",
        "ros1/test_installation.py",
        "runner/executors/test_collecting.py",
        "runner/executors/test_local_pool.py",
        "runner/disturbances/test_policy_view.py",
        "runner/executors/test_served_workers.py",
        "runner/judging/test_faces.py",
        "runner/setup/test_trial_setup.py",
        "runtime/test_numba_cache.py",
        "simulator/test_twins.py",
        "site_checks/test_check.py",
        "site_checks/test_mistakes.py",
        "statistics/test_power_independent.py",
        "test_releases.py",
        "verification/test_hostile_records.py",
        "verification/test_older_records.py",
        "verification/test_verify.py",
        "viewer/test_pair.py",
        "viewer/test_rebuild.py",
        "web/operator/test_page.py",
        "web/results_browser/test_app.py",
        "web/results_browser/test_website.py",
        "web/second_judgement/test_second_judgement_app.py",
        "web/second_judgement/test_second_judgement_in_browser.py",
    }
)
"""Files whose tests take more than 3 s of processor time, or 10 s with waiting; of each package, some stay quick."""

SLOW_FOLDERS = frozenset({"fuzz", "training"})


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Disable garbage collection during collection and freeze its objects: a full collection takes 0.4 s."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark slow tests and tests that start a PostgreSQL server."""
    if gone := sorted(name for name in SLOW if not (HERE / name).is_file()):
        raise pytest.UsageError(f"tests/conftest.py lists files that do not exist: {', '.join(gone)}")
    for item in items:
        place = item.path.relative_to(HERE)
        if place.as_posix() in SLOW or place.parts[0] in SLOW_FOLDERS:
            item.add_marker(pytest.mark.slow)
        chosen = str(getattr(getattr(item, "callspec", None), "params", {}))
        if "postgresql" in getattr(item, "fixturenames", ()) or "postgresql" in chosen:
            item.add_marker(pytest.mark.postgresql)


@pytest.fixture(scope="session", autouse=True)
def migrations_run_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Copy a migrated database for every new SQLite record of this process.

    Running the migrations takes 0.3 s per record; `results/schema/test_migrate.py` tests them.
    """
    from vsnbench.results.database_url import sqlite_path, sqlite_url
    from vsnbench.results.schema.engine import open_engine
    from vsnbench.results.schema.migrate import backup, upgrade
    from vsnbench.results.writing import journal

    directory = tmp_path_factory.mktemp("migrated")
    made, number = directory / "made.db", itertools.count()

    def upgrade_by_copy(engine: "Engine") -> "SchemaState":
        path = sqlite_path(engine.url.render_as_string(hide_password=False))
        if path is not None and not path.exists() and path.parent.is_dir():
            if not made.exists():
                make(made)
            copy = directory / f"{next(number)}.db"
            copy.write_bytes(made.read_bytes())
            try:
                os.link(copy, path)  # atomic: a concurrent creator finds the complete file
            except OSError:
                pass  # it exists already, or `upgrade` reports that it cannot be written
            finally:
                copy.unlink()
        return upgrade(engine)

    def make(record: Path) -> None:
        engine = open_engine(sqlite_url(directory / "first.db"))
        upgrade(engine)
        engine.dispose()
        backup(sqlite_url(directory / "first.db"), record)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(journal, "upgrade", upgrade_by_copy)
        yield
