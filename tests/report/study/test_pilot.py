"""Trials saved by studying progress, from a record's episodes."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests.report.records import Attempt, Lab
from tests.study.studies import small_study
from vsnbench.protocol.judge import EndReason
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.build import read
from vsnbench.report.study.pilot import pilot_pairs, pilot_table


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    """Two models without success, of which one makes more progress everywhere."""
    lab = Lab(tmp_path)
    failed = Attempt("bed", success=False, end_reason=EndReason.STEP_LIMIT, distance_m=3.0, shortest_m=4.0)
    for model, remaining_m in (("near", 1.0), ("far", 3.5)):
        attempts = [replace(failed, start=s, remaining_m=remaining_m + 0.05 * (s % 4)) for s in range(1, 11)]
        lab.write(attempts, model=model)
    return lab


DECIDED = {"stopping": "decided", "about": "these-cells"}


@pytest.mark.parametrize("changes", [{}, DECIDED, {"stopping": "decided"}])
def test_progress_saves_blocks_where_success_shows_nothing(lab: Lab, changes: dict[str, str]) -> None:
    study = small_study(primary={"metric": "progress"}, goals=["bed"], **changes)
    (pair,) = pilot_pairs(read(lab.url, Selection()), study, lab.site.sha256, starts=10)
    assert pair.cells == 10
    assert (pair.success.difference, pair.progress.difference) == (0.0, pytest.approx(2.5 / 4))
    assert pair.saved > 0
    assert pair.progress.found in (None, 1.0)
    table = pilot_table([pair], study)
    assert len(table.rows) == 2


def test_another_site_or_no_shared_cell_shows_nothing(lab: Lab) -> None:
    record = read(lab.url, Selection())
    assert pilot_pairs(record, small_study(goals=["bed"]), "another", starts=10) == ()
    assert pilot_pairs(record, small_study(goals=["chair"]), lab.site.sha256, starts=10) == ()
