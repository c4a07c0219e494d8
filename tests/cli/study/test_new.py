"""`vsnbench study new`: the arms that it accepts."""

from pathlib import Path

import pytest

from tests.cli.console import Typed
from vsnbench.study.file import parse_study, read_text


def test_arms_are_named_by_their_classes(typed: Typed, tmp_path: Path) -> None:
    file = tmp_path / "study.yaml"
    arms = "oracle,our.lab:Walker,late=our.lab:Runner"
    assert typed("study", "new", str(file), "--arm", arms, "--goal", "chair").code == 0
    study = parse_study(read_text(file), str(file))
    models = {name: arm.model for name, arm in study.arms.items()}
    assert models == {"oracle": "oracle", "Walker": "our.lab:Walker", "late": "our.lab:Runner"}


def test_the_next_command_can_be_pasted_and_names_the_record(
    typed: Typed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ("study", "new", "our study.yaml", "--arm", "random,forward", "--goal", "chair")
    assert "vsnbench study check 'our study.yaml'\n" in typed(*words).err
    unlocked = typed("study", "run", "our study.yaml", "--results", "elsewhere")
    assert unlocked.code == 2
    assert "`vsnbench study lock 'our study.yaml' --results elsewhere`" in unlocked.err
