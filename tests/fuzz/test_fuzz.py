"""A few hundred bad inputs for every loader: each is refused in a line, in time and in little memory, or taken."""

import pytest

from tests.fuzz.harness import run
from tests.fuzz.targets import TARGETS

SEED = 1


@pytest.mark.parametrize("name", TARGETS)
def test_nothing_gets_past_a_loader_s_boundary(name: str) -> None:
    count = TARGETS[name].in_suite
    outcome = run(name, SEED, count)
    assert outcome.findings == []
    assert outcome.inputs == count
    assert len(outcome.ends) > 1 or name == "mask r-cnn", (
        "some are taken and some refused, or the inputs are not near enough to good ones"
    )
