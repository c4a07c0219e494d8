"""The configuration file: precedence, sections, errors, and who can have written it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from vsnbench.config import (
    FILE_NAME,
    apply_config_defaults,
    config_defaults,
    isolation_interpreter,
    load_config,
    read_config_file,
)
from vsnbench.errors import UsageError
from vsnbench.settings.user_config import ClusterConfig, ConsoleConfig, IsolationConfig, UserConfig


def by_name(directory: Path, environment: dict[str, str]) -> dict[str, tuple[str, str]]:
    return {each.name: (each.value, each.source) for each in config_defaults(directory, environment)}


def test_the_environment_comes_before_the_file_and_the_nearest_file_counts(tmp_path: Path) -> None:
    file = tmp_path / FILE_NAME
    file.write_text('site = "lab.yaml"\nrobot = "lola2"\nresults = "kept"\n')
    below = tmp_path / "a" / "b"
    below.mkdir(parents=True)
    found = by_name(below, {"VSNBENCH_ROBOT": "turtlebot2"})
    assert found["robot"] == ("turtlebot2", "VSNBENCH_ROBOT")
    assert found["site"] == (str(tmp_path / "lab.yaml"), str(file))
    assert found["results"] == (str(tmp_path / "kept"), str(file))
    assert found["operator"] == ("", "")


def test_the_name_of_an_embedded_site_is_not_a_path(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text('site = "apartment"\n')
    assert read_config_file(tmp_path / FILE_NAME).site == "apartment"


def test_sections_override_built_in_values_and_their_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text(
        '[console]\naddress = "0.0.0.0"\ncertificate = "c.pem"\n'
        '[isolation]\npython = "python3.9"\nmemory_gib = 8\nhide_results = true\n'
        "[cluster]\nworkers = 16\ngpus_per_worker = 0.25\n[models]\nact_timeout_s = 5\n"
    )
    below = tmp_path / "below"
    below.mkdir()
    config = load_config(below)
    assert config.console == ConsoleConfig(address="0.0.0.0", certificate=tmp_path / "c.pem")
    assert config.isolation == IsolationConfig(python=Path("python3.9"), memory_gib=8.0, hide_results=True)
    assert config.cluster == ClusterConfig(workers=16, gpus_per_worker=0.25)
    assert (config.models.act_timeout_s, config.study.model_memory_gib) == (5.0, None)
    assert load_config(Path("/")) == UserConfig()


def test_values_are_passed_to_child_processes_unless_the_environment_has_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / FILE_NAME).write_text('site = "lab.yaml"\nrobot = "lola2"\n')
    monkeypatch.chdir(tmp_path)
    environment = {"VSNBENCH_ROBOT": "turtlebot2"}
    assert [(each.name, each.value) for each in apply_config_defaults(environment)] == [("site", "lab.yaml")]
    assert environment == {"VSNBENCH_ROBOT": "turtlebot2", "VSNBENCH_SITE": "lab.yaml"}


def test_the_default_results_directory_is_next_to_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / FILE_NAME).write_text('site = "lab.yaml"\n')
    (tmp_path / "walker").mkdir()
    monkeypatch.chdir(tmp_path / "walker")
    apply_config_defaults(environment := {})
    assert environment["VSNBENCH_RESULTS"] == str(tmp_path / "results")
    monkeypatch.chdir(tmp_path)
    apply_config_defaults(environment := {})
    assert "VSNBENCH_RESULTS" not in environment


UNTRUSTED = 'results = "kept"\n[isolation]\npython = "./py"\n[console]\naddress = "0.0.0.0"\n'
OTHER_USER = 12345


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a directory with a file that sets an interpreter; the working directory is below it."""
    lab = tmp_path / "lab"
    (lab / "walker").mkdir(parents=True)
    (lab / FILE_NAME).write_text(UNTRUSTED)
    monkeypatch.chdir(lab / "walker")
    monkeypatch.delenv("SUDO_UID", raising=False)
    return lab


def refused_code(directory: Path) -> tuple[str, str]:
    with pytest.raises(UsageError) as refused:
        apply_config_defaults({})
    with pytest.raises(UsageError):
        load_config(directory)
    return refused.value.code, str(refused.value)


@pytest.mark.parametrize(
    ("changed", "mode"), [(FILE_NAME, 0o646), (FILE_NAME, 0o666), (".", 0o777), (".", 0o757)], ids=str
)
def test_a_file_that_others_can_write_is_refused_with_its_keys(lab: Path, changed: str, mode: int) -> None:
    (lab / changed).chmod(mode)
    code, text = refused_code(lab / "walker")
    assert code == "untrusted-config"
    for part in (str(lab / changed), "results, console.address, isolation.python", str(lab / "walker")):
        assert part in text


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a file to another user")
@pytest.mark.parametrize("changed", [FILE_NAME, ".", "link"])
def test_a_file_of_another_user_is_refused(lab: Path, changed: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if changed == "link":
        (lab / FILE_NAME).rename(lab / "link")
        (lab / FILE_NAME).symlink_to("link")
        changed = FILE_NAME
    os.chown(lab / changed, OTHER_USER, OTHER_USER, follow_symlinks=False)
    code, text = refused_code(lab / "walker")
    assert code == "untrusted-config"
    assert f"{lab / changed} belongs to user {OTHER_USER}" in text
    monkeypatch.setenv("SUDO_UID", str(OTHER_USER))
    assert load_config().console.address == "0.0.0.0"


def test_a_group_other_than_the_users_own_cannot_write_the_file(lab: Path) -> None:
    (lab / FILE_NAME).chmod(0o664)
    assert load_config().results == str(lab / "kept")
    if os.getuid() == 0:
        os.chown(lab / FILE_NAME, 0, OTHER_USER)
        assert refused_code(lab)[0] == "untrusted-config"


def test_an_empty_file_of_ones_own_ends_the_search(lab: Path) -> None:
    (lab / FILE_NAME).chmod(0o666)
    (lab / "walker" / FILE_NAME).touch()
    assert load_config().results is None


def test_in_a_directory_with_the_sticky_bit_a_file_of_ones_own_counts(lab: Path) -> None:
    lab.chmod(0o1777)
    assert load_config().results == str(lab / "kept")


def test_isolate_does_not_run_a_program_from_a_directory_above(lab: Path) -> None:
    (lab / "py").write_text(f"#!/bin/sh\ntouch {lab / 'has-run'}\n")
    (lab / "py").chmod(0o755)
    run = [sys.executable, "-m", "vsnbench", "run", "--model", "mine:Model", "--goal", "chair", "--isolate"]
    refused = subprocess.run(run, capture_output=True, text=True, timeout=60, check=False)
    assert refused.returncode == 2, refused.stderr
    assert "isolation.python" in refused.stderr
    assert {path.name for path in lab.iterdir()} == {FILE_NAME, "py", "walker"}


def test_an_interpreter_is_taken_from_the_working_directory_only(lab: Path) -> None:
    with pytest.raises(UsageError) as refused:
        isolation_interpreter()
    assert refused.value.code == "interpreter-above"
    assert f"--isolate {lab}/py" in str(refused.value)
    assert isolation_interpreter(lab) == lab / "py"
    (lab / FILE_NAME).write_text("[isolation]\nmemory_gib = 4\n")
    assert isolation_interpreter() is None
