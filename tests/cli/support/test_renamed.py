"""Spellings of the previous version give an error with the new, existing spelling."""

import shlex

import pytest

from tests.cli.support.test_output import ALL
from vsnbench.cli.support.renamed import RENAMED, refuse_renamed
from vsnbench.config import SECTIONS
from vsnbench.errors import UsageError

OPTIONS = {" ".join(words): {name for each in command.params for name in each.opts} for words, command in ALL.items()}


def command_of(old: str) -> str:
    return next((command for command in OPTIONS if old.startswith(f"{command} ")), "")


@pytest.mark.parametrize("old", [old for old in RENAMED if not old.startswith("--")])
def test_an_old_spelling_is_refused_with_the_new_one(old: str) -> None:
    with pytest.raises(UsageError) as refused:
        refuse_renamed(shlex.split(old))
    assert refused.value.code == ("renamed-spelling" if RENAMED[old] else "removed-spelling")
    assert RENAMED[old] in refused.value.advice


@pytest.mark.parametrize("old", [old for old in RENAMED if not old.startswith("--")])
def test_a_new_spelling_exists_and_the_old_one_does_not(old: str) -> None:
    new, command = RENAMED[old], command_of(old)
    if new.startswith("--"):
        assert new.split()[0].rstrip(",") in OPTIONS[command]
    elif new.startswith("`"):
        assert any(f"[{section}]" in new and new.split("`")[1] in kind.__slots__ for section, kind in SECTIONS.items())
    elif new:
        assert any(known.startswith(new.removesuffix(" NAME")) for known in OPTIONS)
    assert old not in OPTIONS
    assert not (command and old.removeprefix(command).split()[0] in OPTIONS[command])


@pytest.mark.parametrize(
    "words",
    [
        "run --model a --goal b --seed 0-9 --keep none",
        "judge 3 --yes --void x",
        "report --model --sites",
        "run -- --sites",
        "study new --title x --no-blind",
    ],
)
def test_current_spellings_pass(words: str) -> None:
    refuse_renamed(shlex.split(words))
