"""What the commands print of frozen records, and what happens in simulated trials, is as it was.

After a change that is meant, look at `python -m tests.golden`, then `python -m tests.golden --freeze`.
"""

from pathlib import Path

import pytest

from tests.golden import outputs, trials
from tests.golden.__main__ import differences, frozen


def test_outputs_are_as_they_were(tmp_path: Path) -> None:
    left_out = tuple(set(outputs.COMMANDS) - set(outputs.DAILY))
    before = {name: text for name, text in frozen("outputs").items() if not name.startswith(left_out)}
    assert differences(before, outputs.collect(tmp_path, outputs.DAILY)) == []


def test_a_few_trials_are_as_they_were(tmp_path: Path) -> None:
    runs = ("oracle --starts 1-2", "pirlnav --starts 1", "vlv --starts 1")
    now = trials.collect(tmp_path, tuple(f"run --goal chair --workers 1 --model {words}" for words in runs))
    before = frozen("trials")
    assert {name: before[name] for name in now if "campaign key" not in name} == {
        name: text for name, text in now.items() if "campaign key" not in name
    }


@pytest.mark.long
def test_all_outputs_are_as_they_were(tmp_path: Path) -> None:
    assert differences(frozen("outputs"), outputs.collect(tmp_path)) == []


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_all_trials_are_as_they_were(tmp_path: Path) -> None:
    assert differences(frozen("trials"), trials.collect(tmp_path)) == []
