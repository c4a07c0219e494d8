"""Real against simulated results on shared goals and cells, with the value of the twin."""

from pathlib import Path

import pytest

from tests.report.records import Attempt, Lab
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.summary import summarise
from vsnbench.report.build import read
from vsnbench.report.comparison.sim_vs_real import sim_real_pairs
from vsnbench.report.tables.sim_vs_real import cell_agreement_table, sim_vs_real_table, twin_goal_table
from vsnbench.sites.scan import SiteScan


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    """A twin with all cells that is nearly always right, and real trials at nine positions."""
    lab = Lab(tmp_path)
    hard = {2, 3, 8, 11, 14}
    lab.write([Attempt(g, s, success=s not in hard) for g in ("chair", "bed") for s in range(1, 16)])
    real = [Attempt(g, s, success=s not in hard) for g in ("chair", "plant") for s in range(1, 10)]
    lab.write([*real[:4], Attempt("chair", 5, success=False), *real[5:]], simulated=False)
    return lab


def test_totals_over_other_goals_are_not_compared(lab: Lab) -> None:
    record = read(lab.url, Selection())
    (twin,) = sim_real_pairs(summarise(record))
    assert twin.goals == ("chair",)
    assert (twin.first.episodes, twin.second.episodes) == (9, 15)
    assert twin.pairing is not None
    assert len(twin.pairing.outcomes.cells) == 9
    assert twin.difference == pytest.approx(-1 / 9)
    assert twin.interval.low < -1 / 9 < twin.interval.high
    table = sim_vs_real_table(sim_real_pairs(summarise(record)))
    assert table is not None
    assert "-11.11" in [cell.text for cell in table.rows[0].cells]


def test_the_twin_says_how_true_it_is(lab: Lab) -> None:
    (twin,) = sim_real_pairs(summarise(read(lab.url, Selection())))
    like, ranks = twin.agreement, twin.ranks
    assert like is not None
    assert ranks is not None
    assert (like.same, like.bias) == pytest.approx((8 / 9, 1 / 9))
    assert ranks.rho > 0.5


def test_a_true_twin_saves_real_trials(tmp_path: Path) -> None:
    lab, hard, goals = Lab(tmp_path), {2, 3, 8, 11, 14}, ("chair", "bed", "sofa")
    lab.write([Attempt(g, s, success=s not in hard) for g in goals for s in range(1, 16)])
    real = [Attempt(g, s, success=s not in hard) for g in goals for s in range(1, 7)]
    lab.write([*real[:4], Attempt("chair", 5, success=False), *real[5:]], simulated=False)
    record = read(lab.url, Selection())
    (twin,) = sim_real_pairs(summarise(record))
    gain = twin.powered
    assert gain is not None
    assert gain.plain_rate == pytest.approx(11 / 18)
    assert gain.cells == 18
    assert gain.tuning > 0
    assert gain.saved > 0
    assert gain.rate in gain.interval
    table = cell_agreement_table(sim_real_pairs(summarise(record)))
    assert table is not None
    assert "not a primary result" in table.notes[0]


def test_other_places_share_no_cells(lab: Lab, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    other = Lab(tmp_path / "elsewhere", lab.site.model_copy(update={"name": "twin"}))
    other.write([Attempt("chair", s) for s in range(1, 16)])
    Lab(other.directory).write([Attempt("chair", s) for s in range(1, 10)], simulated=False)
    record = read(other.url, Selection())
    (twin,) = sim_real_pairs(summarise(record))
    assert twin.pairing is None
    assert twin.powered is None
    assert cell_agreement_table(sim_real_pairs(summarise(record))) is None
    assert sim_vs_real_table(sim_real_pairs(summarise(record))) is not None


def test_scan_and_drawn_twin_are_compared_with_reality_by_goal(tmp_path: Path) -> None:
    drawn = Lab(tmp_path)
    scanned = Lab(tmp_path, drawn.site.model_copy(update={"scan": SiteScan(sha256="a" * 64)}))
    hard, goals = {2, 3, 8, 11, 14}, ("bed", "chair")
    everything = [(goal, start) for goal in goals for start in range(1, 16)]
    scanned.write([Attempt(g, s, success=s not in hard) for g, s in everything])
    drawn.write([Attempt(g, s, success=s % 2 == 0) for g, s in everything])
    scanned.write([Attempt(g, s, success=s not in hard) for g in goals for s in range(1, 8)], simulated=False)
    results = summarise(read(drawn.url, Selection()))
    pairs = sim_real_pairs(results, by_goal=True)
    assert [pair.pairing is not None for pair in pairs] == [True] * 4  # the survey is the same
    assert {pair.simulated.name for pair in pairs} == {"vlv in the scan", "vlv in the drawn twin"}
    assert {pair.real.name for pair in pairs} == {"vlv real"}
    by_twin = {(pair.goals[0], pair.simulated.twin): pair for pair in pairs}
    assert by_twin["chair", "the scan"].difference == 0
    assert by_twin["chair", "the drawn twin"].difference == pytest.approx(5 / 7 - 3 / 7)
    assert by_twin["chair", "the scan"].powered is not None
    table = twin_goal_table(pairs)
    assert table is not None
    assert [[cell.text for cell in row.cells[:2]] for row in table.rows] == [
        ["chair", "the drawn twin"],
        ["chair", "the scan"],
        ["bed", "the drawn twin"],
        ["bed", "the scan"],
    ]
    without = Lab(tmp_path / "one", drawn.site)
    without.directory.mkdir()
    without.write([Attempt("chair", s) for s in range(1, 16)])
    without.write([Attempt("chair", s) for s in range(1, 4)], simulated=False)
    assert twin_goal_table(sim_real_pairs(summarise(read(without.url, Selection())), by_goal=True)) is None
