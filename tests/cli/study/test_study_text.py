"""Texts of the verbs of a study."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from vsnbench.cli.study.text import duration_line


@pytest.mark.parametrize(
    ("seconds", "stated"), [(0.146, "at 0.146 s"), (180, "at 180 s"), (1200, "at 1200 s"), (4000.5, "at 4000 s")]
)
def test_the_duration_of_a_trial_is_in_plain_digits(seconds: float, stated: str) -> None:
    place = SimpleNamespace(schedule=SimpleNamespace(trials=range(6)))
    assert stated in duration_line(cast("Any", place), cast("Any", None), seconds)
