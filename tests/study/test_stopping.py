import random
from typing import Any

from tests.study.studies import small_study
from vsnbench.study.file import StudyFile
from vsnbench.study.stopping import decide

Blocks = list[dict[str, bool]]


def these(**changes: Any) -> StudyFile:
    """Return a study about its own cells, unless it says otherwise."""
    return small_study(**({"about": "these-cells"} | changes))


def blocks(first: str, second: str, planned: int) -> Blocks:
    done: Blocks = [{"one": a == "x", "two": b == "x"} for a, b in zip(first, second, strict=True)]
    return done + [{} for _ in range(planned - len(done))]


def test_a_clear_lead_decides_long_before_the_plan_is_run() -> None:
    decision = decide(these(stopping="decided"), blocks("x" * 12, "." * 12, 60))
    question = decision.questions[0]
    assert (question.winner, question.decided, question.counted) == ("one", True, False)
    assert decision.over == "the primary analysis is decided"
    assert decision.dropped == {"two": question.decided_at}
    assert question.decided_at is not None
    assert question.decided_at <= 12


def test_what_lies_behind_a_gap_in_the_random_order_is_not_looked_at() -> None:
    some = blocks("x" * 12, "." * 12, 60)
    some[3] = {"one": True}
    assert decide(these(stopping="decided"), some).questions[0].blocks == 3


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
    assert decide(plan, even[:5] + [{} for _ in range(55)]).over == ""


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
        done = [{name: rng.random() < 0.6 for name in plan.arms} for _ in range(30)]
        wrong += any(one.decided for one in decide(plan, done).questions)
    assert wrong <= 4


def test_a_beaten_arm_is_dropped_and_the_others_go_on() -> None:
    plan = these(stopping="decided", arms={name: {"model": f"lab:{name}"} for name in ("one", "two", "three")})
    some = [{"one": True, "two": True, "three": False} for _ in range(14)]
    some += [{"one": place % 2 == 0, "two": place % 2 == 1} for place in range(6)]
    decision = decide(plan, some + [{} for _ in range(40)])
    assert set(decision.dropped) == {"three"}
    assert decision.over == ""
    assert decision.standing == {"one", "two"}
