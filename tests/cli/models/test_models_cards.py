"""`vsnbench models show` and `check` for goal kinds, answer kinds and assumed step sizes."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.console import Answer, vsnbench
from tests.models.remote.servers import CARD, scripted_server

Run = Callable[..., Answer]
CHECKPOINT = Path(__file__).parents[2] / "data" / "pirlnav" / "ckpt.pth"
FIXED = """
from vsnbench import Action, ActionKind, Decision, GoalKind, ModelCard, Policy

class Fixed(Policy):
    card = ModelCard(
        "fixed",
        goal_kinds=frozenset({GoalKind.TEXT, GoalKind.CATEGORY}),
        action_kinds=frozenset({ActionKind.DISCRETE, ActionKind.WAYPOINT}),
        forward_m=0.25,
        turn_deg=30,
    )

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        return Decision(Action.STOP)

class Late(Fixed):
    card = None

    def __init__(self):
        self.card = Fixed.card
"""
WORDS = ("--goal", "chair", "--starts", "1", "--keep", "none")


@pytest.fixture
def run(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> Run:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "cache"))
    (tmp_path / "fixed_steps.py").write_text(FIXED)
    (tmp_path / "small.yaml").write_text("name: small\nforward_m: 0.15\n")
    return lambda *words: vsnbench(monkeypatch, capsys, *words)


EVERY_KIND = ["category", "image", "instruction", "point", "route", "sequence", "text"]


@pytest.mark.parametrize(
    ("model", "shown"),
    [
        ("fixed_steps:Fixed", (["category", "text"], ["discrete", "waypoint"], 0.25, 30)),
        ("fixed_steps:Late", (None, None, None, None)),
        ("oracle-waypoints", (EVERY_KIND, ["discrete", "waypoint"], None, None)),
        ("pirlnav", (["category"], ["discrete"], 0.25, 30.0)),
    ],
)
def test_a_model_is_shown_with_its_kinds_and_assumed_steps(run: Run, model: str, shown: tuple[object, ...]) -> None:
    found = json.loads(run("models", "show", model, "--json").out)
    assert tuple(found[name] for name in ("goal_kinds", "action_kinds", "forward_m", "turn_deg")) == shown
    assert "assumed steps" in run("models", "show", model).out


def test_a_served_model_is_shown_by_its_card(run: Run) -> None:
    card = {**CARD, "goal_kinds": ["text"], "action_kinds": ["velocity"], "turn_deg": 15.0}
    with scripted_server(lambda *_: None, {"type": "card", "wire": 2, "card": card, "jpeg": False}) as url:
        found = json.loads(run("models", "show", url, "--json").out)
    assert (found["name"], found["goal_kinds"], found["action_kinds"]) == ("scripted", ["text"], ["velocity"])
    assert (found["forward_m"], found["turn_deg"], found["sensors"]) == (None, 15.0, ["rgb"])


def warnings(caplog: pytest.LogCaptureFixture) -> list[str]:
    """Return the warnings of steps since the last call."""
    found = [record.getMessage() for record in caplog.records if "assumes" in record.getMessage()]
    caplog.clear()
    return found


def test_a_check_has_the_kinds_and_warns_of_other_steps_than_the_protocol_s(
    run: Run, caplog: pytest.LogCaptureFixture
) -> None:
    paper = run("models", "check", "fixed_steps:Fixed", "--json")
    assert (paper.code, warnings(caplog)) == (0, [])
    (card,) = [finding["seen"] for finding in json.loads(paper.out) if finding["what"] == "card"]
    for part in ("category, text", "discrete, waypoint", "0.25 m and 30°"):
        assert part in card
    assert run("models", "check", "fixed_steps:Fixed", "--protocol", "small.yaml").code == 0
    (warning,) = warnings(caplog)
    assert "0.25 m" in warning
    assert "0.15 m" in warning


def test_a_check_of_weights_warns_of_other_steps_than_the_protocol_s(
    run: Run, caplog: pytest.LogCaptureFixture
) -> None:
    words = ("models", "check", "pirlnav", "--weights", str(CHECKPOINT), "--device", "cpu", "--json")
    report = json.loads(run(*words, "--protocol", "small.yaml").out)
    assert (report["goal_kinds"], report["action_kinds"]) == (["category"], ["discrete"])
    assert (report["forward_m"], report["turn_deg"]) == (0.25, 30.0)
    (warning,) = warnings(caplog)
    assert "0.25 m" in warning
    assert "0.15 m" in warning


def test_a_run_warns_of_other_steps_than_the_protocol_s(run: Run, caplog: pytest.LogCaptureFixture) -> None:
    assert run("run", "--model", "fixed_steps:Fixed", *WORDS).code == 0
    assert warnings(caplog) == []
    assert run("run", "--model", "fixed_steps:Fixed", *WORDS, "--protocol", "small.yaml").code == 0
    (warning,) = warnings(caplog)
    assert "0.25 m" in warning
    assert "0.15 m" in warning


def test_an_episode_shows_the_kind_and_the_words_of_its_goal(run: Run, tmp_path: Path) -> None:
    apartment = Path(__file__).parents[3] / "sites" / "apartment.yaml"
    goal = "goals:\n  - {id: red-chair, kind: text, text: the red chair, targets: [chair-4]}\n"
    (tmp_path / "lab.yaml").write_text(apartment.read_text(encoding="utf-8") + goal, encoding="utf-8")
    words = ("run", "--model", "fixed_steps:Fixed", "--site", "lab.yaml", "--starts", "1", "--keep", "none")
    assert run(*words, "--goal", "red-chair,chair").code == 0
    shown = json.loads(run("episodes", "show", "1", "--json").out)
    assert shown["goal"] == "red-chair"
    definition = shown["goal_definition"]
    assert (definition["kind"], definition["content"]["text"]) == ("text", "the red chair")
    page = run("episodes", "show", "1").out
    assert "text: the red chair" in page
    assert "chair-4" in page
    assert json.loads(run("episodes", "show", "2", "--json").out)["goal_definition"] is None
