"""`models check ws://…` passes a correct server and names the errors of others."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.models.remote.servers import stub_server
from vsnbench.cli.models.models import app
from vsnbench.models.remote.checking import check_server

GOOD = """
class Model:
    card = {"name": "good", "sensors": ["rgb", "depth"], "goals": ["chair"]}

    def reset(self, goal, seed):
        if goal != "chair":
            raise ValueError("only chairs")

    def act(self, observation):
        return "TURN_LEFT"
"""
RESTLESS = """
import random

class Model:
    card = {"name": "restless", "goals": ["chair"]}

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        return random.choice(["TURN_LEFT", "TURN_RIGHT"])
"""


BEGINS_ONLY = """
class Model:
    card = {"name": "begins", "goal_kinds": ["image"], "action_kinds": ["discrete"]}

    def begin(self, task):
        self.size = task.goal.image.shape

    def reset(self, goal, seed):
        raise ValueError("needs the robot's camera")

    def act(self, observation):
        return "TURN_LEFT"
"""
DRIVES_TO_POINTS = BEGINS_ONLY.replace(
    'return "TURN_LEFT"', 'return {"movement": {"kind": "waypoint", "x_m": 1, "y_m": 0}}'
)


def test_a_server_that_needs_a_task_and_takes_photographs_passes_everything(tmp_path: Path) -> None:
    with stub_server(BEGINS_ONLY, tmp_path) as (url, _):
        failed = {finding.what: finding.seen for finding in check_server(url) if not finding.passed}
    assert failed == {}


def test_a_server_whose_answers_are_not_on_its_card_fails(tmp_path: Path) -> None:
    with stub_server(DRIVES_TO_POINTS, tmp_path) as (url, _):
        failed = {finding.what: finding.seen for finding in check_server(url) if not finding.passed}
    assert "answered with waypoint, but its card states discrete" in failed["same seed, same actions"]


HABITAT_AGENT = """
class Agent:
    def reset(self):
        self.goal = None

    def act(self, observations):
        self.goal = observations.get("objectgoal", observations.get("imagegoal", observations.get("instruction")))
        assert self.goal is not None
        return 2
"""


@pytest.mark.parametrize("goal", ["objectgoal", "imagegoal", "instruction"])
def test_a_habitat_agent_of_each_kind_of_goal_passes_everything(goal: str, tmp_path: Path) -> None:
    (tmp_path / "agent.json").write_text(json.dumps({"goal": goal}))
    arguments = ("--habitat-agent", "served_model:Agent", "--settings", "agent.json")
    with stub_server(HABITAT_AGENT, tmp_path, *arguments) as (url, _):
        findings = tuple(check_server(url))
    assert len(findings) == 9
    assert [finding for finding in findings if not finding.passed] == []


def test_a_good_server_passes_everything(tmp_path: Path) -> None:
    with stub_server(GOOD, tmp_path) as (url, _):
        findings = {finding.what: finding for finding in check_server(url)}
    assert [what for what, finding in findings.items() if not finding.passed] == []
    assert "only chairs" in findings["unknown goal"].seen


def test_a_model_that_ignores_its_seed_and_goal_is_told_so(tmp_path: Path) -> None:
    with stub_server(RESTLESS, tmp_path) as (url, _):
        answer = CliRunner().invoke(app, ["check", url, "--json"])
    assert answer.exit_code == 1
    failed = {finding["what"]: finding["seen"] for finding in json.loads(answer.output) if not finding["passed"]}
    assert set(failed) == {"same seed, same actions", "unknown goal"}
    assert "deterministic: False" in failed["same seed, same actions"]


def test_a_model_that_says_it_is_not_deterministic_may_differ(tmp_path: Path) -> None:
    honest = RESTLESS.replace('"goals": ["chair"]', '"deterministic": False')
    with stub_server(honest, tmp_path) as (url, _):
        findings = tuple(check_server(url))
    assert findings
    assert all(finding.passed for finding in findings)
