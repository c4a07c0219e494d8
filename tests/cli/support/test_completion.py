"""Shell completion of values."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.console import vsnbench
from tests.results.records_of_a_lab import plan, run, stopped
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.writing.journal import Journal

Offered = Callable[[Path, str], list[str]]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    with Journal.open(sqlite_url(folder / "vsnbench.db")) as journal:
        for trial in journal.find_or_create_campaign(plan()).trials[:2]:
            run(journal, trial, stopped(success=True))
    return folder


@pytest.fixture
def offered(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Offered:
    """Requests completions as bash does when Tab is pressed at the end of the line."""

    def ask(results: Path, typed: str) -> list[str]:
        monkeypatch.setenv("_VSNBENCH_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", typed)
        monkeypatch.setenv("COMP_CWORD", str(len(typed.split(" ")) - 1))
        monkeypatch.setenv("VSNBENCH_RESULTS", str(results))
        done = vsnbench(monkeypatch, capsys)
        assert (done.code, done.err) == (0, "")
        return done.out.split()

    return ask


@pytest.mark.parametrize(
    ("typed", "word"),
    [
        ("vsnbench run --model pir", "pirlnav"),
        ("vsnbench run --goal chair,so", "chair,sofa"),
        ("vsnbench run --site ap", "apartment"),
        ("vsnbench doctor --robot turtlebot2", "turtlebot2"),
        ("vsnbench view ", "2"),
        ("vsnbench judge ", "1"),
        ("vsnbench report --model ", "random"),
    ],
)
def test_values_are_completed(offered: Offered, results: Path, typed: str, word: str) -> None:
    assert word in offered(results, typed)


GOALS = """
goals:
  - {id: red-chair, kind: text, text: the red chair, targets: [chair-4]}
"""


def test_the_goals_of_the_chosen_site_are_offered(offered: Offered, tmp_path: Path) -> None:
    site = tmp_path / "lab.yaml"
    site.write_text((Path(__file__).parents[3] / "sites" / "apartment.yaml").read_text() + GOALS)
    broken = tmp_path / "broken.yaml"
    broken.write_text("goals: 7")
    assert offered(tmp_path, f"vsnbench run --site {site} --goal red") == ["red-chair"]
    assert offered(tmp_path, f"vsnbench run --site apartment,{site} --goal chair,re") == [
        "chair,refrigerator",
        "chair,red-chair",
    ]
    assert offered(tmp_path, "vsnbench run --goal refr") == ["refrigerator"]
    assert offered(tmp_path, "vsnbench run --goal red") == []
    assert "chair" in offered(tmp_path, f"vsnbench run --site {broken} --goal ch")


def test_without_a_record_nothing_is_offered_and_nothing_is_written(offered: Offered, tmp_path: Path) -> None:
    assert offered(tmp_path / "none", "vsnbench view ") == []
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("typed", "word"),
    [
        ("vsnbench view --results {} ", "2"),
        ("vsnbench judge --db sqlite:///{}/vsnbench.db ", "1"),
        ("vsnbench report --results {} --model ", "random"),
    ],
)
def test_the_record_that_options_name_is_completed_from(
    offered: Offered, tmp_path: Path, results: Path, typed: str, word: str
) -> None:
    assert word in offered(tmp_path / "none", typed.format(results))
