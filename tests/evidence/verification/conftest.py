"""A small record of simulated episodes, and a bundle of it, that tests damage in copies."""

import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from tests.shared_records import made_once, small_record
from vsnbench.evidence.bundle.make import BundleRequest, make_bundle
from vsnbench.evidence.bundle.selection import select_campaigns
from vsnbench.evidence.verification.checks import Verification
from vsnbench.evidence.verification.verify import VerifyOptions, verify
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.settings.user_config import BundleConfig


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes of each of two models; not to be changed."""
    return small_record(tmp_path_factory)


@pytest.fixture
def results(recorded: Path, tmp_path: Path) -> Path:
    """A copy of the record."""
    return Path(shutil.copytree(recorded, tmp_path / "results"))


@pytest.fixture(scope="session")
def bundled(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle of the record; not to be changed."""

    def make(file: Path) -> None:
        request = BundleRequest(lambda record: select_campaigns(record, [1, 2]), BundleConfig())
        make_bundle(ResultsDirectory.locate(recorded), request, file)

    return made_once(tmp_path_factory, "results.zip", make)


def change(results: Path, *statements: str) -> None:
    """Change a database by hand."""
    with closing(sqlite3.connect(results / "vsnbench.db")) as database:
        database.execute("PRAGMA ignore_check_constraints = ON")
        for statement in statements:
            database.execute(statement)
        database.commit()


def verified(path: Path, replay: int | None = 0) -> Verification:
    """Verify without a progress bar."""
    return verify(path, lambda _what, _done, _of: None, VerifyOptions(replay))


def lines(found: Verification) -> list[str]:
    """Return all findings."""
    return [str(finding) for check in found.checks for finding in check.findings]


Change = Callable[[Path], object]
