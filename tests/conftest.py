"""Which tests wait for `make test`, marked here, in one place, by what was measured; and what all tests share."""

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

    from vsnbench.database.migrate import SchemaState

HERE = Path(__file__).parent

settings.register_profile("same", derandomize=True)
"""Generated examples are the same in every run, so that what passes here passes elsewhere; `HYPOTHESIS_PROFILE=default`
draws new ones."""
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))

SLOW = frozenset(
    {
        *("cli/test_doctor.py", "cli/test_hostile_archive.py", "cli/test_models.py", "cli/test_place.py"),
        "cli/test_report.py",
        *("cli/test_run.py", "cli/test_run_keeping.py", "cli/test_run_pirlnav.py", "cli/test_run_with_a_person.py"),
        *("cli/test_sites.py", "cli/test_study.py", "cli/test_sweep.py", "cli/test_view.py"),
        *("examples/test_point_robot.py", "exchange/test_killed_merge.py", "exchange/test_merge.py"),
        *("models/remote/test_serving.py", "models/test_oracle.py", "models/pirlnav/test_checkpoint.py"),
        *("models/pirlnav/test_parity.py", "models/pirlnav/test_policy.py", "models/vlv/test_map_against_site.py"),
        *("models/vlv/test_mask_rcnn.py", "models/vlv/test_policy.py", "models/vlv/test_value_network.py"),
        *("protocol/test_goal_distance.py", "report/test_figures.py", "report/test_figure_layout.py"),
        *("protocol/survey/test_check.py", "protocol/survey/test_mistakes.py"),
        *("report/test_page.py", "simulator/test_twins.py", "runner/pool/test_local.py", "runner/pool/test_merging.py"),
    }
)
"""Files whose tests took together more than 8 s, each file alone on one of two busy cores."""

SLOW_ROOMS = frozenset({"fuzz", "training"})


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Look for no garbage while tests are gathered, and never again among what is there then: a walk takes 0.4 s."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is slow, and what starts a PostgreSQL server."""
    if gone := sorted(name for name in SLOW if not (HERE / name).is_file()):
        raise pytest.UsageError(f"tests/conftest.py marks as slow what has another name now: {', '.join(gone)}")
    for item in items:
        place = item.path.relative_to(HERE)
        if place.as_posix() in SLOW or place.parts[0] in SLOW_ROOMS:
            item.add_marker(pytest.mark.slow)
        chosen = str(getattr(getattr(item, "callspec", None), "params", {}))
        if "postgresql" in getattr(item, "fixturenames", ()) or "postgresql" in chosen:
            item.add_marker(pytest.mark.postgresql)


@pytest.fixture(scope="session", autouse=True)
def migrations_run_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Begin every new SQLite record of this process as a copy of one that the migrations made.

    They take a third of a second, which hundreds of tests would wait for; `database/test_migrate.py` tests them.
    """
    from vsnbench.database import journal
    from vsnbench.database.engine import open_engine
    from vsnbench.database.migrate import backup, upgrade
    from vsnbench.database_url import sqlite_path, sqlite_url

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
                os.link(copy, path)  # a second one that begins it at this moment finds it whole
            except OSError:
                pass  # it has begun, or cannot be written, which is for `upgrade` to say
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
