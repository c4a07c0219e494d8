"""Invalid inputs of every loader are accepted or refused, in time and memory limits.

`make fuzz`, which `make test-long` runs, takes more of them.
"""

import pytest

from tests.fuzz.harness import run
from tests.fuzz.targets import TARGETS

SEED = 1
COUNT = 16
MORE = dict.fromkeys(("site", "protocol", "configuration", "pirlnav"), 96)
"""Inputs of loaders that accept only a few of them."""


@pytest.mark.parametrize("name", TARGETS)
def test_nothing_gets_past_a_loader_s_boundary(name: str) -> None:
    count = MORE.get(name, COUNT)
    outcome = run(name, SEED, count)
    assert outcome.findings == []
    assert outcome.inputs == count
    assert len(outcome.ends) > 1 or name == "mask r-cnn", (
        "the inputs must be close enough to valid ones that some are accepted and some refused"
    )
