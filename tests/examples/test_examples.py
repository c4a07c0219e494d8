"""The examples run as documented, their output is recorded, and the docs show the same code."""

import re
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from tests.cli.console import vsnbench
from tests.models.looks import look
from vsnbench.models.contract_check import check_policy
from vsnbench.models.description import describe_model
from vsnbench.models.registry import create_policy
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.robots.registry import profile_of
from vsnbench.values.encoding.codec import decision_from_record
from vsnbench.values.movement import Action
from vsnbench.values.observation import Sensor, shown_to_policy

ROOT = Path(__file__).resolve().parents[2]
MODELS = (
    "frontier:Frontier",
    "image_goal:HistogramMatcher",
    "instruction:KeywordFollower",
    "sequence:Rememberer",
    "spinner:Spinner",
    "velocity:Reactive",
    "widest_opening:WidestOpening",
)


@pytest.fixture
def run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Callable[..., list[tuple[Any, ...]]]:
    def call(model: str, *words: str) -> list[tuple[Any, ...]]:
        monkeypatch.chdir(ROOT)
        common = ("--goal", "chair", "--starts", "1", "--results", str(tmp_path))
        answer = vsnbench(monkeypatch, capsys, "run", "--model", model, *common, *words)
        assert answer.code == 0, answer.err
        url = ResultsDirectory.locate(tmp_path).path / "vsnbench.db"
        with closing(sqlite3.connect(url)) as database:
            return database.execute(
                "SELECT action, raw_action, probabilities, details FROM step ORDER BY episode_id, number"
            ).fetchall()

    return call


def test_the_spinner_turns_once_around_and_stops(run: Callable[..., list[tuple[Any, ...]]]) -> None:
    actions = [row[0] for row in run("examples.spinner:Spinner")]
    assert actions == ["TURN_LEFT"] * 12 + ["STOP"]


def test_the_widest_opening_is_driven_to_and_what_it_saw_is_kept(run: Callable[..., list[tuple[Any, ...]]]) -> None:
    import json

    steps = run("examples.widest_opening:WidestOpening", "--max-steps", "8")
    assert len(steps) == 8
    assert {row[0] for row in steps} >= {"MOVE_FORWARD"}
    for action, raw_action, probabilities, details in steps:
        shown = decision_from_record(
            Action(action), raw_action, json.loads(probabilities or "null"), json.loads(details)
        )
        assert shown.diagnostics.sub_goal == shown.diagnostics.path[1]
        assert shown.diagnostics.boxes[0].label == "widest"
        assert len(shown.diagnostics.details["free_m"]) == 9
        assert shown.diagnostics.note.endswith("m free ahead")


def test_its_settings_are_part_of_what_it_is_and_a_wrong_one_is_refused(tmp_path: Path) -> None:
    from vsnbench.errors import ModelError

    described = describe_model("examples.widest_opening:WidestOpening").card
    assert described is not None
    assert described.sensors == {Sensor.DEPTH, Sensor.ODOMETRY}
    file = ROOT / "examples" / "widest_opening.yaml"
    policy = create_policy("examples.widest_opening:WidestOpening", model_config=file)
    assert policy.card.settings == {"keep_away_m": 0.9, "actions": 100}
    (tmp_path / "wrong.yaml").write_text("keep_awy_m: 1\n")
    with pytest.raises(ModelError, match="keep_awy_m"):
        create_policy("examples.widest_opening:WidestOpening", model_config=tmp_path / "wrong.yaml")


def test_it_turns_where_the_way_is_closed() -> None:
    policy = create_policy("examples.widest_opening:WidestOpening")
    policy.reset("chair", 0)
    seen = shown_to_policy(look(depth_m=0.4), policy.card.sensors)
    turns = {policy.act(seen).action for _ in range(5)}
    assert len(turns) == 1
    assert turns <= {Action.TURN_LEFT, Action.TURN_RIGHT}


POLICIES = re.findall(
    r"^class (\w+)\((?:Policy|Frontier)\):",
    "".join(file.read_text(encoding="utf-8") for file in sorted((ROOT / "examples").glob("*.py"))),
    re.MULTILINE,
)


def test_every_model_among_the_examples_is_checked() -> None:
    assert sorted(POLICIES) == sorted(name.partition(":")[2] for name in MODELS)


@pytest.mark.parametrize("name", MODELS)
def test_the_examples_pass_models_check(name: str) -> None:
    policy = create_policy(f"examples.{name}")
    assert [finding for finding in check_policy(policy, profile_of("turtlebot2")) if not finding.passed] == []


def code_blocks(document: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", (ROOT / document).read_text(encoding="utf-8"), re.DOTALL)


def test_the_guide_shows_the_spinner_as_it_is() -> None:
    assert (ROOT / "examples" / "spinner.py").read_text(encoding="utf-8") in code_blocks("docs/models.md")


def test_the_policy_of_the_readme_acts() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = re.search(r"\n((?:    from vsnbench import [^\n]*\n)\n(?:    [^\n]*\n|\n)+?)\n    vsnbench try", text)
    assert found is not None
    names: dict[str, Any] = {}
    exec(re.sub(r"^    ", "", found.group(1), flags=re.MULTILINE), names)
    policy = names["Spinner"]()
    policy.reset("chair", 0)
    actions = [policy.act(shown_to_policy(look(depth_m=1.0), policy.card.sensors)).action for _ in range(13)]
    assert actions == [Action.TURN_LEFT] * 12 + [Action.STOP]
