"""Commands with results support --json and --quiet; exit codes; completion."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from tests.cli.console import Typed
from vsnbench.cli.main import VERBS, build_app
from vsnbench.cli.support.output import WITHOUT_RESULT, join_long_lines, resumable
from vsnbench.errors import ExitCode

PAGE = Path(__file__).resolve().parents[3] / "docs" / "command-line.md"


def verbs() -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield every command line verb with its command, found by walking the parser."""
    for verb in VERBS:
        command: Any = get_command(build_app(verb)).commands[verb]  # type: ignore[attr-defined]
        if not hasattr(command, "commands"):
            yield (verb,), command
        for name, own in getattr(command, "commands", {}).items():
            yield (verb, name), own


ALL = dict(verbs())


def test_ctrl_c_with_no_trial_under_way_says_what_next(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(KeyboardInterrupt), resumable():
        raise KeyboardInterrupt
    assert "the same command resumes" in capsys.readouterr().err


def test_what_prints_no_result_is_a_verb_that_there_is() -> None:
    assert ALL.keys() > WITHOUT_RESULT


COMMON = {"--json", "--quiet", "--verbose", "--log-file", "--help"}
MAX_OPTIONS = 26
WIDTH = 78
"""Columns of a terminal, less the margin of a help text."""


def options(command: Any) -> set[str]:
    return {option for parameter in command.params for option in parameter.opts}


def own_options(command: Any) -> set[str]:
    return {each.opts[0] for each in command.params if each.param_type_name == "option"} - COMMON


def helps(command: Any) -> list[str]:
    return [each.help or "" for each in command.params]


RULES: dict[str, Callable[[Any], bool]] = {
    "can log more": lambda command: {"--verbose", "--log-file"} <= options(command),
    "has at most 26 options of its own": lambda command: len(own_options(command)) <= MAX_OPTIONS,
    "has a help sentence for every option and argument": lambda command: all(
        text.endswith(".") and not text[0].islower() for text in helps(command)
    ),
    "fits what is to be typed into a line of the terminal": lambda command: all(
        len(line) <= WIDTH for line in (command.help or "").splitlines() if line.strip().startswith("vsnbench ")
    ),
}


@pytest.mark.parametrize("rule", RULES)
def test_every_command(rule: str) -> None:
    assert [" ".join(words) for words, command in ALL.items() if not RULES[rule](command)] == []


def test_a_verb_that_prints_a_result_knows_json_and_quiet() -> None:
    deaf = [words for words, command in ALL.items() if not {"--json", "--quiet"} <= options(command)]
    assert set(deaf) <= WITHOUT_RESULT


def test_prose_of_a_help_fills_the_terminal_and_what_is_to_be_typed_keeps_its_lines() -> None:
    prose = f"{'Long ' * 20}line\nthat goes on."
    assert join_long_lines(f"First.\n\n    {prose}") == "First.\n\n    " + prose
    assert join_long_lines(f"First.\n\n{prose}") == f"First.\n\n{'Long ' * 20}line that goes on."
    typed = f"Two.\n\nvsnbench {'word ' * 20}\nvsnbench sites\n\n    vsnbench {'word ' * 20}\n    vsnbench"
    assert join_long_lines(typed) == typed


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("VSNBENCH_RESULTS", str(tmp_path / "results"))
    return tmp_path


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("init .", {"files": ["vsnbench.toml", "lab.yaml", ".gitignore"], "kept": []}),
        ("models new walker", {"model": "walker.policy:Walker"}),
        ("robots check turtlebot2", {"robot": "turtlebot2", "warnings": []}),
        ("robots show lola2", {"name": "lola2"}),
        ("sites export apartment --map map.yaml", {"files": ["map.yaml", "map.pgm"]}),
        ("db upgrade", {"schema_before": None}),
        ("study new --arm oracle --arm random --goal chair", {"files": ["study.yaml"]}),
    ],
)
def test_with_json_and_quiet_nothing_but_the_result_is_printed(
    typed: Typed, line: str, expected: dict[str, Any], lab: Path
) -> None:
    answer = typed(*line.split(), "--json", "--quiet")
    assert (answer.code, answer.err) == (0, "")
    told = json.loads(answer.out)
    assert {name: told[name] for name in expected} == expected


def test_notes_are_kept_back_by_quiet_and_errors_are_not(typed: Typed, lab: Path) -> None:
    assert "next: " in typed("init", "loud").err
    quiet = typed("init", "quiet", "-q")
    assert (quiet.err, quiet.out.splitlines()) == (
        "",
        [f"quiet/{name}" for name in ("vsnbench.toml", "lab.yaml", ".gitignore")],
    )
    refused = typed("sites", "check", "nowhere", "--quiet")
    assert refused.code != ExitCode.DONE
    assert refused.err.startswith("vsnbench: error: ")


def test_a_quiet_run_prints_what_is_done_and_nothing_else(typed: Typed, lab: Path) -> None:
    words = ("run", "--model=random", "--goal=chair", "--starts=1", "--max-steps=1")
    answer = typed(*words, "-q")
    assert (answer.code, answer.err) == (ExitCode.DONE, "")
    assert re.fullmatch(r"the only trial is done; results in \S+\n", answer.out)
    as_json = typed(*words, "-q", "--json")
    assert (as_json.err, json.loads(as_json.out)["done"]) == ("", 1)
    swept = typed(*words, "--seed=0-1", "-q")
    assert swept.err == ""
    assert re.fullmatch(r"all 2 trials are done; results in \S+\n", swept.out)


LOUD = """
import os
from vsnbench import Action, Decision, ModelCard, Policy

print("imported")


class Loud(Policy):
    card = ModelCard("loud")

    def reset(self, goal, seed):
        os.write(1, b"direct")

    def act(self, observation):
        print("act")
        return Decision(Action.STOP)
"""


@pytest.mark.parametrize(
    "words",
    [
        "run --goal chair --starts 1 --workers 1",
        "run --goal chair --starts 1 --seed 0-1",
        "stress --goal chair --starts 1 --disturb latency --severity 1 --results s",
        "models check",
        "models show",
        "doctor",
    ],
)
def test_prints_of_a_model_do_not_spoil_the_json(words: str, tmp_path: Path) -> None:
    (tmp_path / "loud.py").write_text(LOUD)
    verb, *rest = words.split()
    named = [verb, *rest, "loud:Loud"] if verb == "models" else [verb, "--model", "loud:Loud", *rest]
    command = [sys.executable, "-m", "vsnbench", *named, "--json"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert json.loads(done.stdout)
    assert "imported" in done.stderr


def test_the_documented_exit_codes_are_those_that_there_are() -> None:
    documented = {int(number) for number in re.findall(r"^\| (\d+) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)}
    assert documented == set(ExitCode)


@pytest.mark.parametrize(
    ("shell", "typed", "expected"),
    [("bash", "si", {"sites"}), ("zsh", "sites che", {"check"}), ("bash", "episodes list --outc", {"--outcome"})],
)
def test_a_shell_that_asks_is_told_what_can_come_next(shell: str, typed: str, expected: set[str], lab: Path) -> None:
    line = f"vsnbench {typed}"
    asked = {
        "bash": {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split()) - 1)},
        "zsh": {"_TYPER_COMPLETE_ARGS": line},
    }[shell]
    answer = subprocess.run(
        [sys.executable, "-m", "vsnbench.cli.main"],
        env=os.environ | asked | {"_VSNBENCH_COMPLETE": f"complete_{shell}"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert expected <= set(re.findall(r"[a-z-]+", answer.stdout)), answer
