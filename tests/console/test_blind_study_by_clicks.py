"""A blind study by clicks on a phone in a real Chromium, which is reloaded and loses its network on the way.

`scripts/console_trials.py` does the same with 75 trials on two phones, kills, and every mishap at every screen.
"""

import random
from pathlib import Path

import pytest

from tests.cli.console import vsnbench
from tests.console.faults import faults
from tests.console.operators import Mishap, operators_at
from tests.console.rehearsal import Rehearsal

pytestmark = [pytest.mark.browser, pytest.mark.slow]


@pytest.mark.timeout(900)
def test_nothing_is_lost_nothing_is_there_twice_and_no_arm_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    mishaps: list[tuple[str, Mishap]] = [
        *(("sign-in", "reload"), ("placing", "reload"), ("judging", "offline"), ("confirming", "reload")),
        ("finish", "reload"),
    ]
    with Rehearsal(tmp_path, 2, 3, in_one_room=True) as run:
        monkeypatch.chdir(tmp_path)
        monkeypatch.syspath_prepend(tmp_path)
        assert vsnbench(monkeypatch, capsys, "study", "lock").code == 0
        with operators_at(run, random.Random(1), mishaps, names=["Anna"]) as people:
            people.spread = False
            people.attend()
            assert faults(people) == []
        assert run.code == 0
        assert mishaps == [], "all of it happened"
