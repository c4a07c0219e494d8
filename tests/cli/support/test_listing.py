"""Lists and tables fit a terminal of 80 columns without broken numbers, dates or words."""

import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest

from tests.cli.console import Answer
from tests.report.records import Attempt, Lab, void
from tests.results.records_of_a_lab import plan
from vsnbench.cli.support.listing import name_column, print_list, prose_column
from vsnbench.protocol.judge import EndReason
from vsnbench.report.table import Column
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.writing.journal import Journal

LONG_NAME = "examples.widest_opening:WidestOpening"


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three models, of which one has a very long name; long end reasons; an episode that awaits a judgement."""
    directory = tmp_path_factory.mktemp("results")
    lab = Lab(directory)
    goals = ("chair", "sofa", "toilet")
    at_the_cap = [Attempt(goal, 15, success=False, end_reason=EndReason.STEP_LIMIT, actions=150) for goal in goals]
    for model, last in (("vlv", 3), ("pirlnav", 2)):
        near = [Attempt(goal, start, success=start < 9) for goal in goals[:last] for start in range(6, 11)]
        lab.write([*near, *at_the_cap[:last]], model=model)
    lab.write([void("toilet", 3)], model=LONG_NAME)
    lab.write([Attempt("toilet", 15, proposed=True)], model="vlv", simulated=False)
    return directory


@pytest.fixture
def shown(record: Path, typed: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Answer]:
    """Runs commands on a terminal of 80 columns, in the parent of the results, whose path is printed in full."""
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.chdir(record.parent)
    monkeypatch.setenv("VSNBENCH_RESULTS", record.name)

    def call(*words: str) -> Answer:
        answer = typed(*words)
        assert answer.code == 0, answer.err
        assert max(map(len, answer.out.splitlines())) <= 80, answer.out
        return answer

    return call


def test_an_episode_is_a_line(shown: Callable[..., Answer]) -> None:
    heading, *lines = shown("episodes", "list", "--limit", "0").out.splitlines()
    assert len(lines) == 6 * 5 + 2
    assert all(re.match(r" +\d+  \S+ +(chair|sofa|toilet) +\d+  ", line) for line in lines)
    assert sum("failure: step_limit  " in line for line in lines) == 5
    assert "void: motion_failed" in lines[-2]
    assert re.search(r" examp\S*…\S*tOpening ", lines[-2]), "the ends of the names differ"
    answer = shown("episodes", "list", "--limit", "1")
    left_out = [name for name in ("began (UTC)", "to goal") if name not in heading]
    assert [name for name in left_out if name not in answer.err] == []


def test_dates_and_counts_of_campaigns_stay_whole(shown: Callable[..., Answer]) -> None:
    lines = shown("db", "status").out.splitlines()[5:]
    today = f"{datetime.now(UTC):%Y-}"
    dated = [line for line in lines if re.search(rf"\d+ of \d+  {today}\d\d-\d\d$", line.rstrip())]
    assert len(dated) == 4
    assert len(lines) == 5, "the long name that distinguishes campaigns continues below"
    assert not any("…" in line for line in lines)


def test_campaigns_that_differ_in_their_seed_alone_say_it(
    tmp_path: Path, typed: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        for seed in (7, 8):
            journal.find_or_create_campaign(plan(seed=seed))
    lines = typed("db", "status", "--results", str(tmp_path)).out.splitlines()
    assert re.search(r"name +seed +", lines[-3])
    assert [re.search(r" (\d+) +0 of 4", line)[1] for line in lines[-2:]] == ["7", "8"]  # type: ignore[index]


def test_the_long_seed_of_an_import_leaves_the_headings_whole(
    tmp_path: Path, typed: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        for seed in (7, 2**62):
            journal.find_or_create_campaign(plan(seed=seed))
    out = typed("db", "status", "--results", str(tmp_path)).out
    assert str(2**62) in out
    assert "…" not in out


@pytest.mark.parametrize(
    "words",
    [
        *("judge --pending", "models list", "robots list", "sites list", "sites show apartment", "config show"),
        *("protocol list", "protocol show ros4vsn", "protocol show onsite-instruction"),
    ],
)
def test_other_lists_fit_too(shown: Callable[..., Answer], words: str) -> None:
    assert "…" not in shown(*words.split()).out


def test_a_comparison_breaks_no_cell(shown: Callable[..., Answer]) -> None:
    lines = shown("compare", "vlv simulated", "pirlnav").out.splitlines()
    assert sum(bool(re.match(r" (all|shared) +\d+/\d+ ", line)) for line in lines) == 2
    assert "Shared goals: chair, sofa." in lines


def test_a_report_breaks_no_end_reason(shown: Callable[..., Answer]) -> None:
    out = shown("report").out
    ends = out[out.index("How episodes ended") :]
    assert len(re.findall(r"^ \S.* (step_limit|motion_failed|stop) +\d+ ", ends, re.MULTILINE)) == 6


def test_into_a_pipe_goes_all_of_it(
    record: Path, typed: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setenv("VSNBENCH_RESULTS", str(record))
    answer = typed("episodes", "list")
    assert LONG_NAME in answer.out
    assert "began (UTC)" in answer.out
    assert "began" not in answer.err


COLUMNS = (
    Column("number"),
    name_column("name"),
    Column("when", number=False, rank=2),
    prose_column("what", rank=1),
    prose_column("why"),
)


@pytest.mark.parametrize("width", [60, 80, 120, 200])
@pytest.mark.parametrize("length", [1, 12, 40, 90])
def test_no_line_is_wider_than_its_terminal(
    width: int, length: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    words = "a door is ajar outside of the view, "
    rows = [("7", "n" * length, "2026-03-02 09:00", (words * 9)[:length], words[:length]), ("12345", "é", "", "", "b")]
    print_list(COLUMNS, rows)
    answer = capsys.readouterr()
    assert max(map(len, answer.out.splitlines())) <= width
    shown = answer.out + answer.err
    assert all(column.heading in shown for column in COLUMNS)
    assert ("2026-03-02 09:00" in answer.out) != ("when" in answer.err)
