"""The design of a stress test, before its first trial."""

import pytest

from vsnbench.runner.setup.stress import weakness_of


def test_a_design_that_can_show_no_loss_is_named_with_the_positions_that_it_needs() -> None:
    words = weakness_of(4, 6)
    assert "smallest possible p-value is 0.12, after correction for 6 conditions 0.75" in words
    assert "use at least 8 positions" in words
    assert weakness_of(1, 1)


@pytest.mark.parametrize(("starts", "disturbances"), [(8, 6), (6, 1), (15, 30)])
def test_a_design_that_can_show_a_loss_is_not(starts: int, disturbances: int) -> None:
    assert weakness_of(starts, disturbances) == ""
