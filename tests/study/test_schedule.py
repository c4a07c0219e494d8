from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.study.studies import small_study
from vsnbench.errors import StudyError
from vsnbench.study.schedule import draw_schedule

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
