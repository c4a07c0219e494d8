import pytest

from tests.study.studies import small_study
from vsnbench.study.design import design_error
from vsnbench.study.units import Block


@pytest.mark.parametrize(
    ("changes", "fewest"),
    [
        ({}, 6),
        ({"alpha": 0.01}, 8),
        ({"arms": {name: {"model": name} for name in ("random", "forward", "oracle")}}, 7),
        ({"primary": {"kind": "rate", "arm": "one", "rate": 0.5}, "goals": ["bed"]}, 4),
        ({"stopping": "decided", "about": "these-cells", "goals": ["bed"]}, 9),
        ({"stopping": "decided", "about": "these-cells"}, 5),
    ],
)
def test_a_design_is_faulted_up_to_the_last_number_of_positions_that_is_too_few(
    changes: dict[str, object], fewest: int
) -> None:
    study = small_study(**changes)
    plans = [
        [Block(goal, start, {}) for goal in study.goals for start in range(starts)] for starts in range(1, fewest + 2)
    ]
    assert [bool(design_error(study, plan)) for plan in plans] == [True] * (fewest - 1) + [False] * 2
