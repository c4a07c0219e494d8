from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.study.studies import small_study
from vsnbench.errors import StudyError
from vsnbench.study.schedule import draw_schedule, schedules_of

STARTS = (1, 2, 3, 4)


def test_the_same_file_and_seed_give_the_same_schedule_for_ever() -> None:
    schedule = draw_schedule(small_study(), STARTS)
    assert schedule == draw_schedule(small_study(), STARTS)
    assert schedule.fingerprint[:16] == "607a739859d5230b"
    assert schedule != draw_schedule(small_study(seed=8), STARTS)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**63 - 1), repetitions=st.integers(1, 3), order=st.sampled_from(["blocks", "shuffled"]))
def test_every_trial_is_scheduled_once_and_every_block_holds_every_arm(seed: int, repetitions: int, order: str) -> None:
    schedule = draw_schedule(small_study(seed=seed, repetitions=repetitions, order=order), STARTS)
    trials = [(one.arm, one.goal, one.start, one.repetition) for one in schedule.trials]
    assert len(set(trials)) == len(trials) == 2 * 2 * 4 * repetitions
    assert [one.rank for one in schedule.trials] == list(range(len(trials)))
    assert set(Counter(one.block for one in schedule.trials).values()) == {2}
    if order == "blocks":
        assert [one.block for one in schedule.trials] == sorted(one.block for one in schedule.trials)


def test_orders_of_arms_and_blocks_are_even() -> None:
    first, cells, codes = Counter[str](), Counter[tuple[str, int]](), Counter[str]()
    for seed in range(200):
        schedule = draw_schedule(small_study(seed=seed), STARTS)
        first[schedule.trials[0].arm] += 1
        cells[schedule.trials[0].goal, schedule.trials[0].start] += 1
        codes[schedule.codes["one"]] += 1
    assert 70 < first["one"] < 130
    assert 70 < codes["A"] < 130
    assert len(cells) == 8
    assert max(cells.values()) < 50


def test_as_planned_runs_arm_after_arm() -> None:
    arms = [one.arm for one in draw_schedule(small_study(order="as-planned"), STARTS).trials]
    assert arms == ["one"] * 8 + ["two"] * 8


def test_a_goal_of_one_arm_is_run_by_it_alone_and_excluded_cells_by_nobody() -> None:
    study = small_study(arms={"one": {"model": "random", "goals": ["sofa"]}, "two": {"model": "forward"}})
    schedule = draw_schedule(study, STARTS, excluded={("bed", 2)})
    assert {one.arm for one in schedule.trials if one.goal == "sofa"} == {"one"}
    assert not [one for one in schedule.trials if (one.goal, one.start) == ("bed", 2)]
    with pytest.raises(StudyError, match="excludes every shared goal"):
        draw_schedule(small_study(goals=["bed"]), (2,), excluded={("bed", 2)})


LIKE = {"stopping": "decided", "about": "cells-like-these"}


def test_a_study_about_other_positions_runs_one_position_after_another() -> None:
    schedule = draw_schedule(small_study(**LIKE, repetitions=2), STARTS)
    starts = [one.start for one in schedule.trials]
    assert len([start for at, start in enumerate(starts) if start not in starts[:at]]) == 4
    assert sum(a != b for a, b in pairwise(starts)) == 3
    assert set(Counter(one.block for one in schedule.trials).values()) == {2}


def test_the_order_of_positions_and_of_cells_within_them_is_random() -> None:
    first, within = Counter[int](), Counter[tuple[str, int]]()
    for seed in range(200):
        schedule = draw_schedule(small_study(**LIKE, seed=seed, repetitions=2), STARTS)
        first[schedule.trials[0].start] += 1
        within[schedule.trials[0].goal, schedule.trials[0].repetition] += 1
    assert len(first) == len(within) == 4
    assert max(first.values()) < 75
    assert max(within.values()) < 75


@pytest.mark.parametrize("locked", [{}, {"stopping": "decided", "about": "these-cells"}, LIKE])
@pytest.mark.parametrize("now", [{}, {"stopping": "decided", "about": "these-cells"}, LIKE])
def test_a_locked_schedule_is_found_again_whatever_was_amended(locked: dict[str, str], now: dict[str, str]) -> None:
    schedule = draw_schedule(small_study(**locked), STARTS)
    found = schedules_of(small_study(**now), STARTS)
    assert found[0] == draw_schedule(small_study(**now), STARTS)
    assert schedule.fingerprint in {one.fingerprint for one in found}


def test_studies_that_were_locked_by_earlier_versions_keep_their_order() -> None:
    earlier = "607a739859d5230b"
    assert [one.fingerprint[:16] for one in schedules_of(small_study(**LIKE), STARTS)].index(earlier) == 1
