"""Evidence for the places of a goal over several views."""

import numpy as np
import pytest

from vsnbench.models.vlv.detectors.contract import Reliability
from vsnbench.models.vlv.goal_memory import GoalMemory, GoalSurface

WEAK = Reliability.measured(0.3, precision=0.6, recall=0.5)
"""A place is accepted after four views; a miss has half the weight of a view."""


def seen_at(x_m: float, y_m: float = 0.0) -> GoalSurface:
    return GoalSurface(x_m, np.array([[x_m, y_m], [x_m, y_m + 0.1]]))


def after(reliability: Reliability, *views: tuple[float, ...]) -> GoalMemory:
    """Return the memory after views, each with distances of detections; the place at 3 m is always in view."""
    memory = GoalMemory(reliability)
    for view in views:
        memory.update([seen_at(x_m) for x_m in view], lambda point: point[0] == pytest.approx(3.0, abs=0.5))
    return memory


def test_two_views_suffice_for_a_reliable_detector() -> None:
    assert [len(after(Reliability(0.5), *[(3.0,)] * count).believed) for count in (1, 2)] == [0, 1]


def test_a_weak_detector_needs_as_many_views_as_its_precision_asks_for() -> None:
    assert [len(after(WEAK, *[(3.0,)] * count).believed) for count in (3, 4)] == [0, 1]


def test_a_miss_of_a_weak_detector_weighs_less() -> None:
    views = [(3.0,)] * 5 + [()]
    assert len(after(WEAK, *views, ()).believed) == 1
    assert len(after(WEAK, *views, (), ()).believed) == 0
    assert len(after(Reliability(0.5), *[(3.0,)] * 3, ()).believed) == 1
    assert len(after(Reliability(0.5), *[(3.0,)] * 3, (), ()).believed) == 0


def test_two_boxes_in_a_view_are_one_view_of_a_weak_detector() -> None:
    assert after(WEAK, (3.0, 3.1), (3.0, 3.1)).places[0].observations == 2


def test_only_the_best_place_of_a_weak_detector_counts() -> None:
    views = [(3.0, 8.0)] * 4
    assert len(after(WEAK, *views).believed) == 2
    (best,) = after(WEAK, *views, (3.0,)).believed
    assert best.centre[0] == pytest.approx(3.0)
    assert len(after(Reliability(0.5), *views, (3.0,)).believed) == 2
