"""SR, SPL, SoftSPL and path length, against hand-computed values and invariants."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.protocol.metrics import (
    heading_change_deg_per_m,
    ideal_time_s,
    known_progress,
    path_length_m,
    progress,
    sct,
    soft_spl,
    spl,
    success_rate,
)
from vsnbench.values.pose import Pose

metres = st.floats(0, 100)


def test_success_rate_of_the_papers_vlv_table() -> None:
    assert success_rate([True] * 22 + [False] * 53) == pytest.approx(0.2933, abs=1e-4)


def test_success_rate_of_nothing_is_not_a_number() -> None:
    assert math.isnan(success_rate([]))


@pytest.mark.parametrize(
    ("success", "shortest_m", "path_m", "expected"),
    [(True, 4, 4, 1), (True, 4, 8, 0.5), (True, 4, 3, 1), (False, 4, 4, 0), (True, 0, 0, 1), (True, 0, 2, 0)],
)
def test_spl_by_hand(success: bool, shortest_m: float, path_m: float, expected: float) -> None:
    assert spl(success, shortest_m, path_m) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("shortest_m", "remaining_m", "path_m", "expected"),
    [(4, 0, 4, 1), (4, 2, 4, 0.5), (4, 2, 8, 0.25), (4, 6, 4, 0), (0, 0, 0, 1), (0, 1, 1, 0)],
)
def test_soft_spl_by_hand(shortest_m: float, remaining_m: float, path_m: float, expected: float) -> None:
    assert soft_spl(shortest_m, remaining_m, path_m) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("shortest_m", "remaining_m", "expected"),
    [(4, 0, 1), (4, 1, 0.75), (4, 4, 0), (4, 9, 0), (0, 0, 1), (0, 0.1, 0)],
)
def test_progress_by_hand(shortest_m: float, remaining_m: float, expected: float) -> None:
    assert progress(shortest_m, remaining_m) == pytest.approx(expected)


@given(shortest_m=metres, remaining_m=metres)
def test_progress_is_soft_spl_without_a_detour(shortest_m: float, remaining_m: float) -> None:
    assert progress(shortest_m, remaining_m) == soft_spl(shortest_m, remaining_m, 0.0)


@pytest.mark.parametrize("lengths", [(None, 1.0), (1.0, None), (math.inf, 1.0), (1.0, math.nan)])
def test_progress_is_missing_where_a_length_is(lengths: tuple[float | None, float | None]) -> None:
    assert known_progress(*lengths) is None
    assert known_progress(4.0, 1.0) == 0.75


def test_heading_change_adds_turns_of_both_directions_the_shorter_way_round() -> None:
    poses = [Pose.from_degrees(0, 0, heading) for heading in (0, 30, 0, 350, 10)]
    assert heading_change_deg_per_m(poses, 2.0) == pytest.approx((30 + 30 + 10 + 20) / 2)
    assert heading_change_deg_per_m(poses, 0.2) is None


@given(success=st.booleans(), shortest_m=metres, path_m=metres)
def test_spl_is_never_more_than_success(success: bool, shortest_m: float, path_m: float) -> None:
    assert 0 <= spl(success, shortest_m, path_m) <= success


@given(shortest_m=metres, remaining_m=metres, path_m=metres)
def test_soft_spl_is_a_share_and_a_longer_path_never_helps(
    shortest_m: float, remaining_m: float, path_m: float
) -> None:
    share = soft_spl(shortest_m, remaining_m, path_m)
    assert 0 <= share <= 1
    assert soft_spl(shortest_m, remaining_m, path_m + 1) <= share


@pytest.mark.parametrize(
    ("success", "shortest_m", "taken_s", "expected"),
    [(True, 6, 20, 0.5), (True, 6, 10, 1), (True, 6, 5, 1), (False, 6, 10, 0), (True, 0, 0, 1), (True, 0, 2, 0)],
)
def test_sct_by_hand_at_600_mm_a_second(success: bool, shortest_m: float, taken_s: float, expected: float) -> None:
    assert sct(success, ideal_time_s(shortest_m, 0.6), taken_s) == pytest.approx(expected)


@given(success=st.booleans(), ideal_s=metres, taken_s=metres)
def test_sct_is_a_share_and_more_time_never_helps(success: bool, ideal_s: float, taken_s: float) -> None:
    share = sct(success, ideal_s, taken_s)
    assert 0 <= share <= success
    assert sct(success, ideal_s, taken_s + 1) <= share


def test_path_length_follows_the_corners() -> None:
    assert path_length_m([Pose(0, 0), Pose(3, 0), Pose(3, 4)]) == pytest.approx(7)
    assert path_length_m([Pose(1, 1)]) == 0
