"""`vsnbench init`, `config show` and `models new`, in the order of a new lab."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from tests.cli.console import Answer
from vsnbench.cli.main import VERBS, build_app
from vsnbench.config import BUILT_IN_ROBOT, BUILT_IN_SITE, apply_config_defaults
from vsnbench.results.files.directory import ResultsDirectory

VARIABLES = ("VSNBENCH_SITE", "VSNBENCH_ROBOT", "VSNBENCH_RESULTS", "VSNBENCH_OPERATOR", "VSNBENCH_WEIGHTS")
PATIENCE_S = 120.0
Type = Callable[..., Answer]


def environment(**more: str) -> dict[str, str]:
    here = str(Path(__file__).parents[2])
    inherited = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    return {**inherited, "PYTHONPATH": os.pathsep.join([here, inherited.get("PYTHONPATH", "")]), **more}


@pytest.fixture
def type_in(typed: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Answer]:
    """Run `vsnbench` in a directory, with no vsnbench environment variables except these."""

    def type_there(cwd: Path, *words: str, **more: str) -> Answer:
        with monkeypatch.context() as there:
            for name in VARIABLES:
                there.delenv(name, raising=False)
            for name, value in more.items():
                there.setenv(name, value)
            there.setenv("COLUMNS", "200")
            there.chdir(cwd)
            return typed(*words)

    return type_there


def test_a_lab_begins_with_three_commands(type_in: Type, tmp_path: Path) -> None:
    begun = type_in(tmp_path, "init", "lab")
    assert begun.code == 0, begun.err
    lab = tmp_path / "lab"
    assert "next: cd lab && vsnbench sites check lab.yaml" in begun.err
    assert type_in(lab, "sites", "check", "lab.yaml").code == 0
    words = ("run", "--model", "oracle", "--goal", "chair", "--starts", "1", "--keep", "none")
    run = type_in(lab, *words)
    assert run.code == 0, run.err
    assert f"site lab.yaml, robot simulated (from {lab / 'vsnbench.toml'})" in run.err
    report = json.loads(type_in(lab, "report", "--format", "json").out)
    assert [(model["name"], model["site"]) for model in report["models"]] == [("oracle", "lab")]
    again = type_in(lab, "init")
    assert again.out.count("not changed") == 3


def test_config_show_says_where_each_default_comes_from(type_in: Type, tmp_path: Path) -> None:
    (tmp_path / "vsnbench.toml").write_text('robot = "lola2"\nsite = "apartment"\n')
    shown = type_in(tmp_path, "config", "show", "--json", VSNBENCH_ROBOT="turtlebot2")
    found = {each["name"]: (each["value"], each["source"]) for each in json.loads(shown.out)}
    assert found["robot"] == ("turtlebot2", "VSNBENCH_ROBOT")
    assert found["site"] == ("apartment", str(tmp_path / "vsnbench.toml"))
    assert found["results"] == ("results", "built in")
    assert found["weights"][0].endswith("vsnbench/weights")
    assert found["operator"][0]
    table = type_in(tmp_path, "config", "show").out
    assert re.search(r"^results +results +built in +VSNBENCH_RESULTS *$", table, re.MULTILINE)


def test_a_flag_comes_before_environment_and_file(type_in: Type, tmp_path: Path) -> None:
    (tmp_path / "vsnbench.toml").write_text('site = "nowhere.yaml"\n')
    words = ("run", "--model", "oracle", "--goal", "chair", "--starts", "99")
    assert "nowhere.yaml" in type_in(tmp_path, *words).err
    assert "elsewhere.yaml" in type_in(tmp_path, *words, VSNBENCH_SITE="elsewhere.yaml").err
    flagged = type_in(tmp_path, *words, "--site", "apartment", VSNBENCH_SITE="elsewhere.yaml").err
    assert "elsewhere" not in flagged
    assert "99" in flagged


def test_a_package_begun_with_models_new_passes_its_own_tests(type_in: Type, tmp_path: Path) -> None:
    begun = type_in(tmp_path, "models", "new", "my-model")
    assert begun.code == 0, begun.err
    assert "models check my_model.policy:MyModel" in begun.err
    made = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests"],
        cwd=tmp_path / "my-model",
        env=environment(),
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert made.returncode == 0, made.stdout
    assert "2 passed" in made.stdout
    assert "not empty" in type_in(tmp_path, "models", "new", "my-model").err


def test_what_is_next_can_be_typed_also_where_the_directory_has_a_space(type_in: Type, tmp_path: Path) -> None:
    assert (
        "next: cd 'my model' && vsnbench models check my_model." in type_in(tmp_path, "models", "new", "my model").err
    )


def test_a_run_that_watches_runs_again_when_the_model_changes(type_in: Type, tmp_path: Path) -> None:
    type_in(tmp_path, "models", "new", "spinning")
    here = tmp_path / "spinning"
    policy = here / "spinning" / "policy.py"
    words = ("--model", "spinning.policy:Spinning", "--goal", "chair", "--starts", "1", "--max-steps", "2", "--watch")
    command = [sys.executable, "-m", "vsnbench.cli.main", "run", *words, "--keep", "none"]
    log = tmp_path / "log"
    with log.open("wb") as sink:
        watching = subprocess.Popen(command, cwd=here, env=environment(), stdout=sink, stderr=sink)
    try:
        until(log, "passed; waiting for a change of spinning")
        assert "1 of 1 trial done\nuntil the next change: vsnbench episodes list --results /" in log.read_text()
        assert "next: vsnbench" not in log.read_text()
        policy.write_text(policy.read_text().replace("depth_m.shape", "depth_m.shap"))
        until(log, "exit code 1; waiting for a change of spinning")
        assert "an episode is void: act: AttributeError" in log.read_text()
    finally:
        watching.send_signal(signal.SIGINT)
        assert watching.wait(PATIENCE_S) == 130
    assert not (here / "results").exists()


def until(log: Path, text: str) -> None:
    give_up_s = time.monotonic() + PATIENCE_S
    while text not in log.read_text(errors="replace"):
        assert time.monotonic() < give_up_s, log.read_text(errors="replace")
        time.sleep(0.05)


def test_what_a_lab_says_holds_for_every_verb_that_takes_a_site_or_a_robot() -> None:
    deaf = [
        f"{verb} {name} {option}"
        for verb in VERBS
        for name, command in commands_of(verb).items()
        for parameter in command.params
        for option, built_in in (("--site", BUILT_IN_SITE), ("--robot", BUILT_IN_ROBOT))
        if option in parameter.opts and parameter.default == built_in and parameter.envvar is None
    ]
    assert deaf == []


def commands_of(verb: str) -> dict[str, Any]:
    command: Any = get_command(build_app(verb)).commands[verb]  # type: ignore[attr-defined]
    return getattr(command, "commands", {"": command})


def test_a_study_is_planned_in_the_labs_own_flat_and_says_so(type_in: Type, tmp_path: Path) -> None:
    type_in(tmp_path, "init", "lab")
    words = (
        "study",
        "new",
        "s.yaml",
        "--title",
        "t",
        "--question",
        "q",
        "--arm",
        "oracle",
        "--arm",
        "random",
        "-g",
        "chair",
    )
    made = type_in(tmp_path / "lab", *words)
    assert "site lab.yaml, robot simulated (from " in made.err
    assert 'site: "lab.yaml"' in (tmp_path / "lab" / "s.yaml").read_text()
    checked = type_in(tmp_path / "lab", "study", "check", "s.yaml")
    assert "6 trials in 3 cells" in checked.out + checked.err, "all starting positions of the flat"


def test_the_next_command_repeats_no_directory_that_the_labs_file_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "vsnbench.toml").write_text('results = "kept"\n')
    (below := tmp_path / "model").mkdir()
    monkeypatch.chdir(below)
    monkeypatch.delenv("VSNBENCH_RESULTS", raising=False)
    apply_config_defaults(environment := {})
    assert ResultsDirectory.locate(environment=environment).options == ""
    assert ResultsDirectory.locate(Path("results")).options == " --results results"
    monkeypatch.setenv("VSNBENCH_RESULTS", "elsewhere")
    assert ResultsDirectory.locate(tmp_path / "kept").options == f" --results {tmp_path / 'kept'}"
    assert ResultsDirectory.locate().options == " --results elsewhere"
