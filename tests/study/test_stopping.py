import random
from collections.abc import Sequence
from typing import Any

import pytest

from tests.study.studies import small_study
from vsnbench.study.file import StudyFile
from vsnbench.study.schedule import draw_schedule
from vsnbench.study.stopping import decide, min_units
from vsnbench.study.units import Block


def these(**changes: Any) -> StudyFile:
    """Return a study, by default about its own cells."""
    return small_study(**({"about": "these-cells"} | changes))


def placed(results: Sequence[dict[str, bool]], per_start: int = 1) -> list[Block]:
    """Return blocks, with a number of consecutive ones from each starting position."""
    return [Block("bed", place // per_start + 1, known) for place, known in enumerate(results)]


def results(first: str, second: str, planned: int) -> list[dict[str, bool]]:
    done = [{"one": a == "x", "two": b == "x"} for a, b in zip(first, second, strict=True)]
    return done + [{} for _ in range(planned - len(done))]


def blocks(first: str, second: str, planned: int, per_start: int = 1) -> list[Block]:
    return placed(results(first, second, planned), per_start)


def test_a_clear_lead_decides_long_before_the_plan_is_run() -> None:
    decision = decide(these(stopping="decided"), blocks("x" * 12, "." * 12, 60))
    question = decision.questions[0]
    assert (question.winner, question.decided, question.counted) == ("one", True, False)
    assert decision.over == "the primary analysis is decided"
    assert decision.dropped == {"two": question.decided_at}
    assert question.decided_at is not None
    assert question.decided_at <= 12


def test_what_lies_behind_a_gap_in_the_random_order_is_not_looked_at() -> None:
    some = results("x" * 12, "." * 12, 60)
    some[3] = {"one": True}
    assert decide(these(stopping="decided"), placed(some)).questions[0].units == 3


def test_a_lead_of_two_at_the_end_is_counted_and_proves_nothing() -> None:
    decision = decide(these(stopping="decided"), blocks("xx" + "x." * 29, "..." + "x." * 28 + ".", 60))
    question = decision.questions[0]
    assert question.decided
    assert question.counted


def test_of_cells_like_these_a_small_lead_decides_nothing_and_a_hopeless_study_ends() -> None:
    plan = these(stopping="decided", about="cells-like-these")
    even = blocks("x." * 28, ".x" * 28, 60)
    decision = decide(plan, even)
    assert not decision.questions[0].decided
    assert decision.over == "what is left could not change the answer"
    assert decide(plan, blocks("x." * 2, ".x" * 2, 60)).over == ""


def test_a_margin_is_harder_to_beat_than_nothing() -> None:
    some = blocks("x" * 40, "x" * 28 + "." * 12, 200)
    assert decide(these(stopping="decided"), some).questions[0].p < 0.05
    assert decide(these(stopping="decided", margin=0.25), some).questions[0].p > 0.2


def test_one_arm_against_a_rate_is_asked_alone() -> None:
    plan = these(stopping="decided", primary={"kind": "rate", "arm": "two", "rate": 0.5})
    decision = decide(plan, blocks("." * 20, "x" * 20, 100))
    assert [one.second for one in decision.questions] == [None]
    assert decision.questions[0].winner == "two"


def test_three_equal_arms_are_rarely_told_apart_looking_after_every_block() -> None:
    plan = these(
        stopping="decided",
        about="cells-like-these",
        arms={name: {"model": f"lab:{name}"} for name in ("one", "two", "three")},
    )
    rng = random.Random(1)
    wrong = 0
    for _ in range(30):
        done = placed([{name: rng.random() < 0.6 for name in plan.arms} for _ in range(30)])
        wrong += any(one.decided for one in decide(plan, done).questions)
    assert wrong <= 4


def test_a_beaten_arm_is_dropped_and_the_others_go_on() -> None:
    plan = these(stopping="decided", arms={name: {"model": f"lab:{name}"} for name in ("one", "two", "three")})
    some = [{"one": True, "two": True, "three": False} for _ in range(14)]
    some += [{"one": place % 2 == 0, "two": place % 2 == 1} for place in range(6)]
    decision = decide(plan, placed(some + [{} for _ in range(40)]))
    assert set(decision.dropped) == {"three"}
    assert decision.over == ""


LIKE = {"stopping": "decided", "about": "cells-like-these"}


def test_a_starting_position_is_one_value_however_many_cells_and_repetitions_it_has() -> None:
    once = decide(these(**LIKE), blocks("xx.x.x", "..x...", 15)).questions[0]
    firsts, seconds = ("".join(mark * 10 for mark in marks) for marks in ("xx.x.x", "..x..."))
    copied = decide(these(**LIKE), blocks(firsts, seconds, 150, per_start=10)).questions[0]
    assert (copied.units, copied.trials, copied.cells) == (6, 60, 6)
    assert (copied.p, copied.low, copied.high, copied.difference) == (once.p, once.low, once.high, once.difference)


def test_a_starting_position_counts_only_when_it_is_complete() -> None:
    decision = decide(these(**LIKE), blocks("x" * 59, "." * 59, 75, per_start=5))
    question = decision.questions[0]
    assert (question.units, question.trials, decision.unit) == (11, 55, "starting position")
    assert (decision.planned_units, question.winner, question.decided_at) == (15, "one", 7)


def test_copies_of_few_starting_positions_never_decide_about_others() -> None:
    decision = decide(these(**LIKE), blocks("x" * 300, "." * 300, 300, per_start=50))
    assert decision.questions[0].winner is None
    assert decision.over == "every block is run"


@pytest.mark.parametrize(
    ("changes", "per_start", "planned", "earliest"),
    [
        (LIKE, 1, 15, 7),
        (LIKE, 10, 150, 7),
        (LIKE, 10, 60, None),
        ({"stopping": "decided"}, 5, 75, 9),
        (LIKE | {"arms": {name: {"model": f"lab:{name}"} for name in ("one", "two", "three")}}, 1, 15, 8),
        (LIKE | {"primary": {"kind": "rate", "arm": "one", "rate": 0.5}}, 5, 75, 7),
    ],
    ids=["starts", "goals change nothing", "too few starts", "these cells", "three arms", "a fixed rate"],
)
def test_the_earliest_decision_is_known_beforehand(
    changes: dict[str, Any], per_start: int, planned: int, earliest: int | None
) -> None:
    study = these(**changes)
    empty = placed([{} for _ in range(planned)], per_start)
    assert min_units(study, empty) == earliest
    wins = placed([{name: name == "one" for name in study.arms}] * planned, per_start)
    assert decide(study, wins).questions[0].decided_at == earliest


def test_a_schedule_of_mixed_positions_counts_each_when_its_last_block_is_done() -> None:
    plan = these(**LIKE, starting_positions="1-9", repetitions=2)
    mixed = draw_schedule(these(stopping="decided", repetitions=2), tuple(range(1, 10)))
    order = {one.block: Block(one.goal, one.start, {"one": True, "two": False}) for one in mixed.trials}
    whole = [order[block] for block in sorted(order)]
    first_complete = min(
        place + 1 for place in range(len(whole)) if whole[place].start not in {b.start for b in whole[place + 1 :]}
    )

    def after(done: int) -> int:
        known = [b if at < done else Block(b.goal, b.start, {}) for at, b in enumerate(whole)]
        return decide(plan, known).questions[0].units

    assert (after(first_complete - 1), after(first_complete), after(len(whole))) == (0, 1, 9)


def nearer(count: int, planned: int, **values: float) -> list[Block]:
    """Return blocks without successes, with the progress of each arm."""
    failed = {"one": False, "two": False}
    done = [Block("bed", start + 1, failed, values) for start in range(count)]
    return done + [Block("bed", start + 1, {}) for start in range(count, planned)]


def test_progress_decides_a_study_in_which_nobody_succeeds() -> None:
    some = nearer(20, 60, one=0.8, two=0.3)
    assert decide(these(stopping="decided"), some).questions[0].winner is None
    (question,) = decide(these(stopping="decided", primary={"metric": "progress"}), some).questions
    assert (question.winner, question.successes) == ("one", (0, 0))
    assert question.means == pytest.approx((0.8, 0.3))
    assert question.low < 0.5 < question.high


def test_a_result_without_progress_ends_the_units_that_are_looked_at() -> None:
    some = nearer(20, 60, one=0.8, two=0.3)
    some[4] = Block("bed", 5, {"one": True, "two": False}, {"one": 1.0})
    assert decide(these(stopping="decided", primary={"metric": "progress"}), some).questions[0].units == 4
