"""`vsnbench try` with small policies, each with another fault: the lines say what is wrong."""

import json
import sys
from pathlib import Path

import pytest

from tests.cli.console import Answer, Typed

HEAD = """
import math, sys, time
from vsnbench import Action, ActionKind, Decision, ModelCard, Move, Policy, Sensor, Waypoint

class {name}(Policy):
    card = ModelCard("{model}", sensors=frozenset({{Sensor.DEPTH}}){kinds})

    def reset(self, goal, seed):
        self.count = 0

    def act(self, observation):
        self.count += 1
"""


def policy(name: str, act: str, kind: str = "") -> str:
    """Return the source of a policy with one method of its own."""
    kinds = f", action_kinds=frozenset({{ActionKind.DISCRETE, ActionKind.{kind}}})" if kind else ""
    head = HEAD.format(name=name, model=name.lower(), kinds=kinds)
    return head + "".join(f"        {line}\n" for line in act.splitlines())


@pytest.fixture
def tried(typed: Typed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Write a file, and run `vsnbench try` with it in its directory."""
    monkeypatch.setenv("VSNBENCH_ROBOT", "simulated:turtlebot2@64x48")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.chdir(tmp_path)

    def run(file: str, source: str, *words: str) -> Answer:
        (tmp_path / file).write_text(source)
        return typed("try", file, *words)

    yield run
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", "") or "").startswith(str(tmp_path)):
            del sys.modules[name]


def words_of(answer: Answer) -> str:
    """Return the ten lines as one, after their form was checked."""
    lines = answer.out.splitlines()
    assert 6 <= len(lines) <= 16, answer.out
    assert [line for line in lines if len(line) > 80 and not line.startswith(("film", "next"))] == []
    assert [line.split()[0] for line in lines[-2:]] == ["film", "next"]
    return " ".join(answer.out.split())


def test_a_good_model_is_shown_with_its_film_and_the_next_command(typed: Typed, monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setenv("VSNBENCH_ROBOT", "simulated:turtlebot2@64x48")
    answer = typed("try", "oracle", "--results", str(tmp_path / "mine"), "--goal", "bed")
    words = words_of(answer)
    assert answer.code == 0
    assert "check none: the model receives the site" in words
    assert "trial 1 bed from 1: success" in words
    assert "trial 2 bed from 2: success" in words
    assert "to do" not in words
    assert f"film vsnbench browse --results {tmp_path / 'mine'}" in words
    assert "next vsnbench run --model oracle --goal bed" in words
    shown = typed("episodes", "list", "--json", "--results", str(tmp_path / "mine"))
    assert [episode["success"] for episode in json.loads(shown.out)] == [True, True]


def test_a_model_that_turns_for_ever_may_have_a_wrong_unit(tried) -> None:
    millimetres = "if (observation.depth_m < 500).any():\n    return Decision(Action.TURN_LEFT)\n"
    answer = tried(
        "inmm.py", policy("InMillimetres", f"{millimetres}return Decision(Action.MOVE_FORWARD)"), "--starts", "1"
    )
    words = words_of(answer)
    assert answer.code == 0, "a failed search is not a failed check"
    assert "failure, turned in circles" in words
    assert "all 150 actions were TURN_LEFT" in words
    assert "to do it never drives: check units; depth and pose are in metres" in words


def test_a_model_that_is_blocked_is_told_where(tried) -> None:
    answer = tried("ahead.py", policy("Ahead", "return Decision(Waypoint(1.0, 0.0))", "WAYPOINT"), "--starts", "1")
    words = words_of(answer)
    assert "failure, stuck and blocked" in words
    assert "of 150 waypoints were blocked" in words
    assert " at the " in words or " at a wall" in words
    assert "to do a blocked answer moves nothing" in words


def test_a_model_that_never_stops_is_told_from_which_action_it_could(tried) -> None:
    driven = """
from vsnbench.models.baselines.oracle import Oracle
from vsnbench import Action, Decision

class Unstoppable(Oracle):
    def reset(self, goal, seed):
        super().reset(goal, seed)
        self.there = False

    def act(self, observation):
        decision = Decision(Action.TURN_LEFT) if self.there else super().act(observation)
        self.there = self.there or decision.action is Action.STOP
        return Decision(Action.TURN_LEFT) if self.there else decision
"""
    words = words_of(tried("unstoppable.py", driven, "--goal", "bed", "--starts", "1"))
    assert "failure, reached, did not stop" in words
    assert "STOP would have succeeded from action" in words
    assert "to do it never answers STOP: answer Action.STOP within 1 m of the goal" in words


def test_a_slow_model_gets_shorter_trials_and_is_told_how_long_it_takes(tried, monkeypatch) -> None:
    monkeypatch.setattr("vsnbench.runner.setup.trying.CHECK_S", 1.0)
    monkeypatch.setattr("vsnbench.runner.setup.trying.TRIAL_S", 0.2)
    monkeypatch.setattr("vsnbench.runner.setup.trying.MIN_ACTIONS", 3)
    slow = "time.sleep(0.05 if observation.depth_m.shape != (48, 64) else 4.0)\n"
    slow += "return Decision(Action.TURN_LEFT if self.count % 2 else Action.TURN_RIGHT)"
    answer = tried("slow.py", policy("Slow", slow), "--starts", "1")
    words = words_of(answer)
    assert "time median 4.0 s an action" in words
    assert "trials were shortened from 150 to 3 actions" in words
    assert "to do slow: a robot waits 4.0 s for an answer and moves for" in words
    assert "check units" not in words, "three actions do not show that it searches badly"


def test_a_model_whose_first_answers_compile_gets_whole_trials(tried) -> None:
    slow_at_first = "time.sleep(0.3 if Warming.loaded < 3 else 0.0)\nWarming.loaded += 1\nreturn Decision(Action.STOP)"
    source = policy("Warming", slow_at_first).replace("    def reset", "    loaded = 0\n\n    def reset")
    words = words_of(tried("warming.py", source, "--starts", "1"))
    assert "stopped far off" in words
    assert "shortened" not in words


@pytest.mark.parametrize(
    ("act", "kind", "expected"),
    [
        ("return Decision(Waypoint(120, -30))", "WAYPOINT", "this looks like centimetres; in metres it is 1.23693"),
        ("return Decision(Move(0.25, 90))", "MOVE", "this looks like degrees; in radians it is 1.571"),
    ],
)
def test_an_answer_in_another_unit_is_named(tried, act: str, kind: str, expected: str) -> None:
    answer = tried(f"in_{kind.lower()}.py", policy("Unit", act, kind))
    words = words_of(answer)
    assert answer.code == 1
    assert expected in words
    assert "chair from 1: void" in words


def test_degrees_that_are_possible_radians_are_noticed(tried) -> None:
    act = "return Decision(Move(0.0, 5.0) if self.count < 30 else Action.STOP)"
    words = words_of(tried("possible.py", policy("Possible", act, "MOVE"), "--starts", "1"))
    assert "to do 29 turns by more than 180°: angles are in radians, 90° is math.radians(90)" in words


def test_a_broken_model_is_shown_with_its_line(tried) -> None:
    answer = tried("broken.py", policy("Broken", 'return {}["weights"]'))
    words = words_of(answer)
    assert answer.code == 1
    assert "same seed, same actions and" in words
    assert "KeyError: 'weights' (broken.py, line 13)" in words
    assert "void, act: KeyError: 'weights'" in words
    assert "next vsnbench try broken:Broken --goal chair" in words


def test_a_model_that_exits_ends_its_trial_and_not_the_command(tried) -> None:
    answer = tried("leaving.py", policy("Leaving", "sys.exit(3)"))
    words = words_of(answer)
    assert answer.code == 1
    assert "SystemExit: 3 (leaving.py, line 13)" in words
    assert "chair from 1: void" in words


def test_the_result_in_json_has_checks_trials_and_commands(tried) -> None:
    answer = tried("steady.py", policy("Steady", "return Decision(Action.STOP)"), "--json")
    found = json.loads(answer.out)
    assert found["model"] == "steady:Steady"
    assert all(check["passed"] for check in found["checks"])
    assert [trial["cause"] for trial in found["trials"]] == ["stopped far off", "stopped far off"]
    assert found["next"] == "vsnbench run --model steady:Steady --goal chair"


def test_results_without_a_directory_of_their_own_stay_after_the_command(tried, typed: Typed) -> None:
    def directory(answer: Answer) -> Path:
        return Path(json.loads(answer.out)["film"].rpartition(" ")[2])

    first = directory(tried("once.py", policy("Once", "return Decision(Action.STOP)"), "--json"))
    assert len(json.loads(typed("episodes", "list", "--json", "--results", str(first)).out)) == 2


TWO = policy("First", "return Decision(Action.STOP)") + policy("Second", "return Decision(Action.STOP)")
PLAIN = "class Walker:\n    def act(self, observation):\n        return 1\n"


@pytest.mark.parametrize(
    ("file", "source", "words", "code"),
    [
        ("pair.py", TWO, "pair.py has 2 policies: choose one: pair.py:First or pair.py:Second", 2),
        ("bare.py", "x = 1", "bare.py has no policy: define a class that derives from vsnbench.Policy", 2),
        ("plain.py", PLAIN, "plain.py has no policy: derive Walker from vsnbench.Policy", 2),
        ("typo.py", "import numpyy", "typo.py: cannot import it: ModuleNotFoundError: No module named 'numpyy'", 1),
        ("syntax.py", "def act(:", "syntax.py: cannot import it: SyntaxError: invalid syntax (syntax.py, line 1)", 1),
        ("quits.py", "import sys\nsys.exit(4)", "it ends the process when it is imported: SystemExit: 4 (quits.py", 1),
        ("ends.py", "import os\nos._exit(0)", "ends.py: cannot import it: the model called os._exit(0)", 1),
        ("with-dash.py", "x = 1", "with-dash.py cannot be imported: a module's file ends with .py", 2),
        ("json.py", TWO, "Python imports another module json", 2),
    ],
)
def test_a_file_without_exactly_one_policy_is_refused_in_a_line(
    tried, file: str, source: str, words: str, code: int
) -> None:
    answer = tried(file, source)
    assert answer.code == code
    assert words in answer.err
    assert answer.err.count("\n") == 1, answer.err
    assert answer.out == ""


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("walkr.py", "no file walkr.py: did you mean walker.py?"),
        ("nowhere.policy", "no file, module or model nowhere.policy: it is neither installed nor in"),
        ("orcale", "no file, module or model orcale: did you mean oracle?"),
        ("mylab/", "mylab is a directory: name the file that has the policy: mylab/policy.py"),
        ("mylab/policy.py:Other", "mylab.policy has no Other; it has mylab.policy:Mine"),
        ("ws://127.0.0.1:1", "runs elsewhere"),
        ("human:ada", "a person"),
    ],
)
def test_what_is_no_policy_of_this_process_is_refused_in_a_line(
    typed: Typed, tried, tmp_path: Path, given: str, words: str
) -> None:
    (tmp_path / "mylab").mkdir()
    (tmp_path / "mylab" / "__init__.py").touch()
    (tmp_path / "mylab" / "policy.py").write_text(policy("Mine", "return Decision(Action.STOP)"))
    (tmp_path / "walker.py").touch()
    answer = typed("try", given)
    assert answer.code in (1, 2)
    assert words in answer.err
    assert answer.err.count("\n") == 1, answer.err


def test_a_file_of_a_package_is_imported_with_its_package(tried, typed: Typed, tmp_path: Path, monkeypatch) -> None:
    package = tmp_path / "outer" / "walks"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "sizes.py").write_text("COUNT = 3\n")
    source = policy("Relative", "return Decision(Action.STOP)").replace(
        "import math", "from .sizes import COUNT\nimport math"
    )
    (package / "policy.py").write_text(source)
    answer = typed("try", str(package / "policy.py"), "--json")
    assert json.loads(answer.out)["next"] == (
        f"cd {tmp_path / 'outer'} && vsnbench run --model walks.policy:Relative --goal chair"
    )
