"""A goal that cannot be run gives an error line and exit code 2, and nothing is written."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.console import Answer, vsnbench
from tests.sites.goal_sites import GOALS, write_site

CATEGORIES_ONLY = "tests.cli.turning:Turning"
Lab = Callable[..., Answer]


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Lab:
    monkeypatch.chdir(tmp_path)

    def run(*words: str, goals: str = GOALS) -> Answer:
        write_site(tmp_path, goals)
        (tmp_path / "notes.png").write_text("this is not an image")
        with (tmp_path / "large.png").open("wb") as file:
            file.write((tmp_path / "bed.png").read_bytes())
            file.truncate(50_000_000)
        return vsnbench(monkeypatch, capsys, *words)

    return run


def refused(answer: Answer, *words: str) -> None:
    assert answer.code == 2
    *warnings, error = answer.err.strip().splitlines()
    assert all("WARNING" in line for line in warnings), answer.err
    assert all(word in error for word in words), answer.err


def run_words(goal: str, model: str = "oracle", starts: str = "1") -> tuple[str, ...]:
    words = ("run", "--model", model, "--site", "lab.yaml", "--goal", goal, "--starts", starts)
    return (*words, "--results", "results", "--quiet")


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("targets: [armchair]", "targets: [armchairs]", ("red-armchair", "armchairs")),
        ("image: bed.png", "image: notes.png", ("photo-bed", "notes.png")),
        ("image: bed.png", "image: large.png", ("photo-bed", "large.png", "5 MB")),
        ("image: bed.png", "image: gone.png", ("photo-bed", "gone.png")),
        ("starts: [1, 2, 3]", "starts: [77]", ("to-the-kitchen", "77")),
    ],
)
def test_a_goal_that_the_site_file_does_not_define_is_refused(
    lab: Lab, tmp_path: Path, old: str, new: str, named: tuple[str, ...]
) -> None:
    assert old in GOALS
    goals = GOALS.replace(old, new)
    refused(lab(*run_words("chair"), goals=goals), "lab.yaml", *named)
    assert not (tmp_path / "results").exists()
    refused(lab("sites", "draw", "lab.yaml", "--goal", "chair", goals=goals), *named)
    checked = lab("sites", "check", "lab.yaml", goals=goals)
    assert checked.code == 1, "a failed check"
    assert sum(line.startswith("error:") for line in checked.out.splitlines()) == 1


def test_a_study_of_goals_that_an_arm_cannot_take_is_not_locked(lab: Lab, tmp_path: Path) -> None:
    arms = ("--arm", f"words={CATEGORIES_ONLY}", "--arm", "forward")
    made = lab("study", "new", *arms, "--goal", "red-armchair", "--site", "lab.yaml", "--starts", "1-2")
    assert made.code == 0
    refused(lab("study", "lock", "--force"), "red-armchair", "text")
    assert not (tmp_path / "results").exists()


def test_starts_that_a_goal_does_not_hold_for_are_named_and_left_out(lab: Lab) -> None:
    answer = lab(*run_words("to-the-kitchen", "random", "2,5"), "--max-steps", "1", "--keep", "none")
    assert answer.code == 0
    listed = lab("episodes", "list", "--results", "results", "--json")
    assert listed.out.count('"start": 2') == 1
    assert '"start": 5' not in listed.out
