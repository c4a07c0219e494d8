"""`study status` accounts for every trial, and `study report` prints no number that it does not have."""

import json
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.cli.console import Answer
from tests.results.locked_study import lock_drawn, run_ranks
from tests.results.records_of_a_lab import begun, run, stopped
from tests.study.studies import study_text
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.writing.journal import Journal

Typed = Callable[..., Answer]


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[Journal]:
    (tmp_path / "study.yaml").write_text(study_text(), encoding="utf-8")
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as opened:
        yield opened


def test_a_trial_whose_process_died_is_left_and_one_of_a_live_process_runs(
    tmp_path: Path, journal: Journal, typed: Typed
) -> None:
    study = lock_drawn(journal, study_text())
    run_ranks(journal, study, range(4))
    begun(journal, journal.study_progress(study.id)[4].trial)
    words = ("study", "status", str(tmp_path / "study.yaml"), "--results", str(tmp_path))

    def counts() -> dict[str, int]:
        arms = json.loads(typed(*words, "--json").out)["arms"]
        return {name: sum(arm[name] for arm in arms) for name in ("done", "left", "running", "void_attempts")}

    assert counts() == {"done": 4, "left": 11, "running": 1, "void_attempts": 0}
    with closing(sqlite3.connect(tmp_path / "vsnbench.db")) as database:
        database.execute("UPDATE process SET boot_id = 'another'")
        database.commit()
    assert counts() == {"done": 4, "left": 12, "running": 0, "void_attempts": 0}
    assert "lost      1 to a process that died" in typed(*words).out


def test_a_report_on_too_few_starting_positions_has_no_interval_and_no_p(
    tmp_path: Path, journal: Journal, typed: Typed
) -> None:
    study = lock_drawn(journal, study_text())
    for planned in journal.study_progress(study.id):
        if planned.trial.start <= 2:
            run(journal, planned.trial, stopped(success=planned.arm == "one"), steps=1)
    said = typed("study", "report", str(tmp_path / "study.yaml"), "--results", str(tmp_path)).out
    assert "nan" not in said
    assert "An interval needs 3 starting positions" in said
    row = next(line for line in said.splitlines() if "open" in line)
    assert row.split()[-2:] == ["–", "–"]
