"""The examples with movements run as documented and reach the goal."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from tests.cli.console import vsnbench
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.sites.site import load_site
from vsnbench.values.goal import GoalKind

ROOT = Path(__file__).resolve().parents[2]
SITE = "examples/goals.yaml"
Run = Callable[..., tuple[list[str], set[str]]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Run:
    def call(model: str, goal: str, *options: str) -> tuple[list[str], set[str]]:
        monkeypatch.chdir(ROOT)
        common = ("--workers", "1", "--results", str(tmp_path))
        answer = vsnbench(monkeypatch, capsys, "run", "--model", f"examples.{model}", "--goal", goal, *common, *options)
        assert answer.code == 0, answer.err
        with closing(sqlite3.connect(ResultsDirectory.locate(tmp_path).path / "vsnbench.db")) as database:
            ends = [row[0] for row in database.execute("SELECT end_reason FROM episode WHERE distance_to_goal_m < 1")]
            return ends, {row[0] for row in database.execute("SELECT action FROM step")}

    return call


def test_the_explorer_reaches_the_goal_by_waypoints(run: Run) -> None:
    ends, actions = run("frontier:Frontier", "plant", "--starts", "8")
    assert ends == ["stop"]
    assert actions == {"WAYPOINT", "STOP"}


def test_the_reactive_policy_drives_by_velocities_to_the_goal_in_sight(run: Run) -> None:
    ends, actions = run("velocity:Reactive", "chair", "--starts", "5")
    assert ends == ["stop"]
    assert actions == {"VELOCITY", "STOP"}


def test_the_follower_turns_passes_one_thing_and_stops_at_the_next(run: Run) -> None:
    ends, actions = run("instruction:KeywordFollower", "around-to-the-sofa", "--site", SITE, "--starts", "14")
    assert ends == ["stop"]
    assert actions == {"WAYPOINT", "STOP"}


def test_the_matcher_drives_to_what_the_photograph_shows(run: Run) -> None:
    ends, actions = run("image_goal:HistogramMatcher", "photo-sofa", "--site", SITE, "--starts", "6")
    assert ends == ["stop"]
    assert actions == {"WAYPOINT", "STOP"}


@pytest.mark.parametrize(
    ("model", "goal"), [("instruction:KeywordFollower", "photo-bed"), ("image_goal:HistogramMatcher", "chair")]
)
def test_a_goal_of_another_kind_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, model: str, goal: str
) -> None:
    monkeypatch.chdir(ROOT)
    options = ("--model", f"examples.{model}", "--goal", goal, "--site", SITE, "--results", str(tmp_path / "r"))
    assert vsnbench(monkeypatch, capsys, "run", *options).code == 2
    assert not (tmp_path / "r").exists()


def test_the_site_of_the_examples_is_the_apartment_with_goals_of_every_kind() -> None:
    site = load_site(ROOT / SITE)
    assert site.sha256 == load_site("apartment").sha256
    kinds = [goal.kind for goal in site.goals]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        GoalKind.TEXT: 3,
        GoalKind.IMAGE: 3,
        GoalKind.INSTRUCTION: 3,
        GoalKind.POINT: 1,
        GoalKind.ROUTE: 1,
        GoalKind.SEQUENCE: 6,
    }
    told = [start for goal in site.goals if goal.kind is GoalKind.INSTRUCTION for start in goal.starts]
    assert sorted(told) == [start.number for start in site.starts]


@pytest.mark.parametrize("example", sorted((ROOT / "examples").glob("*.py")), ids=lambda path: path.name)
def test_an_example_has_fewer_than_120_lines(example: Path) -> None:
    assert len(example.read_text(encoding="utf-8").splitlines()) < 120
