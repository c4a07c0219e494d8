from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.report.study.test_primary import SHOWN, standing
from tests.study.studies import small_study
from tests.study.test_stopping import blocks
from vsnbench.errors import StudyError
from vsnbench.report.study.conclusion import conclusion
from vsnbench.report.study.primary import analyse
from vsnbench.statistics.conclusion import Conclusion
from vsnbench.statistics.multiple import simultaneous
from vsnbench.study.file import StudyFile, parse_study
from vsnbench.study.looks import confidence_of, earliest_decision, looks_of
from vsnbench.study.power import design_of_study, looked_studies, simulated_arms
from vsnbench.study.stopping import decide
from vsnbench.study.units import Block

THREE = {"arms": {name: {"model": f"lab:{name}"} for name in ("one", "two", "three")}}
EQUIVALENT = {"primary": {"kind": "equivalence"}, "margin": 0.3}
NOT_INFERIOR = {"primary": {"kind": "non-inferiority", "arm": "one"}, "margin": 0.3}


def looked(**changes: Any) -> StudyFile:
    """Return a study that is analysed at looks."""
    return small_study(stopping="decided", **changes)


def said(study: StudyFile, starts: int, succeeds: Any) -> str:
    return conclusion(study, analyse(study, standing(study, starts, succeeds)), SHOWN, None)


def test_a_clear_lead_is_decided_at_a_look_and_not_between_looks() -> None:
    for done, decided_at in ((7, None), (8, 8), (10, 8)):
        decision = decide(looked(), blocks("x" * done, "." * done, 15))
        assert decision.questions[0].decided_at == decided_at
        assert decision.over == ("the primary analysis is decided" if decided_at else "")
    assert decision.dropped == {"two": 8}
    assert decision.looks == (8, 11, 15)


def test_results_after_a_look_change_nothing_until_the_next() -> None:
    first, second = "xxx.xxx.", "x.x...x."
    at_look = decide(looked(), blocks(first, second, 15)).questions[0]
    later = decide(looked(), blocks(first + "xx", second + "..", 15)).questions[0]
    assert (later.units, later.p, later.low, later.high) == (8, at_look.p, at_look.low, at_look.high)
    assert decide(looked(), blocks(first + "xxx", second + "...", 15)).questions[0].units == 11


def test_a_lead_that_nothing_can_make_significant_ends_the_study() -> None:
    assert (
        decide(looked(), blocks("x." * 5 + "x", ".x" * 5 + ".", 15)).over == "what is left could not change the answer"
    )
    assert decide(looked(), blocks("x.x.xxxx", "x.xxx.x.", 15)).over == ""


def test_three_arms_drop_the_beaten_one_and_the_others_go_on() -> None:
    done = [{"one": True, "two": place > 3, "three": False} for place in range(11)]
    decision = decide(looked(**THREE), [Block("bed", place + 1, known) for place, known in enumerate(done + [{}] * 4)])
    assert decision.looks == (11, 15)
    assert set(decision.dropped) == {"three"}
    assert decision.over == ""


def test_a_winner_needs_the_interval_too_and_the_interval_is_the_one_that_is_reported() -> None:
    decision = decide(looked(), blocks("x" * 15, "." * 6 + "x" * 9, 15))
    question = decision.questions[0]
    assert question.conclusion is Conclusion.FIRST_BETTER
    assert question.low > 0
    assert question.p is not None
    assert question.p <= 0.05


@pytest.mark.parametrize(
    ("changes", "difference"),
    [({}, 0.4), ({**EQUIVALENT, "margin": 0.4}, 0.1), (NOT_INFERIOR, 0.1), ({"margin": 0.1}, 0.5)],
)
def test_simulated_studies_end_as_the_study_itself_would(changes: dict[str, Any], difference: float) -> None:
    study = looked(**changes)
    design = design_of_study(study, 12, 0.5)
    arms = simulated_arms(np.random.default_rng(4), design, difference, samples=60)
    looks = looks_of(study, 12)
    found = looked_studies(study, arms.mean(-1), design.trials, looks)
    assert np.count_nonzero(found.signs) > 5
    for place in range(60):
        outcomes = arms[:, place].astype(bool)
        some = [
            Block(study.goals[at[1]], at[0] + 1, {"one": bool(outcomes[0][at]), "two": bool(outcomes[1][at])})
            for at in np.ndindex(outcomes.shape[1:])
        ]
        question = decide(study, some).questions[0]
        answer = {"one": 1, "two": -1, None: int(question.decided)}[question.winner if question.decided else None]
        assert (answer, question.units) == (found.signs[place], found.units[place])


def test_equal_arms_are_equivalent_within_a_margin_and_never_called_equal_or_better() -> None:
    words = said(looked(**EQUIVALENT), 15, lambda _arm, _goal, start: start % 2 == 0)
    assert words.startswith("Arm B and arm A differ by less than 30 points in success on the shared goals")
    assert "better" not in words
    assert "equal" not in words
    words = said(looked(**EQUIVALENT), 15, lambda arm, _goal, start: start % 2 == 0 or (arm == "one" and start < 9))
    assert words.startswith("It was not shown that arm B and arm A differ by less than 30 points")


def test_an_arm_is_not_inferior_however_much_better_it_is() -> None:
    words = said(looked(**NOT_INFERIOR), 15, lambda arm, _goal, start: arm == "one" or start % 2 == 0)
    assert words.startswith("Arm B is at most 30 points worse than arm A in success")
    words = said(looked(**NOT_INFERIOR), 15, lambda arm, _goal, start: arm == "two" or start % 2 == 0)
    assert words.startswith("It was not shown that arm B is at most 30 points worse than arm A")


@pytest.mark.parametrize("changes", [EQUIVALENT, NOT_INFERIOR], ids=["equivalence", "non-inferiority"])
def test_a_whole_plan_is_analysed_once_by_the_same_test(changes: dict[str, Any]) -> None:
    study = small_study(**changes)
    trials = standing(study, 12, lambda _arm, _goal, start: start % 2 == 0)
    (answer,) = analyse(study, trials).answers
    assert answer.conclusion in (Conclusion.EQUIVALENT, Conclusion.NOT_INFERIOR)
    assert answer.low > -0.3
    missing = [*trials[:-1], standing(study, 12, lambda *_: None)[-1]]
    (answer,) = analyse(study, missing).answers
    assert answer.conclusion is Conclusion.INCOMPLETE


def test_the_interval_of_equivalence_is_the_one_of_a_difference_and_of_compare() -> None:
    def shown(_arm: str, goal: str, start: int) -> bool:
        return (start + len(goal)) % 3 == 0

    plans = (small_study(), small_study(**EQUIVALENT))
    one, other = (analyse(study, standing(study, 12, shown)).answers[0] for study in plans)
    assert (one.low, one.high) == (other.low, other.high)
    assert confidence_of(small_study(**EQUIVALENT)) == simultaneous(1)
    assert confidence_of(small_study(**EQUIVALENT, **THREE)) == simultaneous(3)


def test_progress_decides_a_study_in_which_nobody_succeeds() -> None:
    failed = {"one": False, "two": False}
    some = [Block("bed", start, failed, {"one": 0.9, "two": 0.2}) for start in range(1, 16)]
    assert decide(looked(), some).questions[0].winner is None
    assert decide(looked(primary={"metric": "progress"}), some).questions[0].winner == "one"


def test_one_arm_against_a_rate_is_decided_by_the_repeated_interval() -> None:
    plan = looked(primary={"kind": "rate", "arm": "two", "rate": 0.5})
    question = decide(plan, blocks("." * 15, "x" * 15, 15)).questions[0]
    assert (question.second, question.winner, question.p) == (None, "two", None)
    assert decide(plan, blocks("x" * 15, "." * 15, 15)).questions[0].decided


def test_looks_end_with_the_last_position_and_none_comes_after_it() -> None:
    assert looks_of(looked(looks=[6, 10]), 12) == (6, 10, 12)
    assert looks_of(looked(looks=[6, 12]), 12) == (6, 12)
    with pytest.raises(StudyError) as refused:
        looks_of(looked(looks=[8, 20]), 15)
    assert refused.value.code == "look-after-end"


@pytest.mark.parametrize(
    ("changes", "starts", "earliest"),
    [({}, 15, 8), ({}, 8, 8), ({}, 5, None), (THREE, 15, 11), (EQUIVALENT, 15, 11), ({"margin": 0.6}, 6, None)],
)
def test_the_first_look_that_can_decide_is_known_beforehand(
    changes: dict[str, Any], starts: int, earliest: int | None
) -> None:
    planned = [Block(goal, start, {}) for start in range(starts) for goal in ("bed", "chair")]
    assert earliest_decision(looked(**changes), planned) == earliest


_BY_POSITION = (
    "betting confidence sequence with replacement, at every starting position, whose goals and repetitions are one "
    "value; Holm over all pairs"
)
_BY_BLOCK = "betting confidence sequence without replacement, at every block; Holm over all pairs"
_BETTER = "Arm B is better than arm A on the shared goals: 24 against 4 of 24 cells."
_MORE_OFTEN = (
    "Arm B succeeded more often than arm A in this plan's trials: 24 against 4 of 24 cells; whether a model is better "
    "is not shown: where outcomes vary within a cell, equal models differ by chance."
)


@pytest.mark.parametrize(
    ("about", "method", "words", "beaten_at", "numbers"),
    [
        ("cells-like-these", _BY_POSITION, _BETTER, 8, (0.004013803785088782, 0.257, 0.979)),
        ("these-cells", _BY_BLOCK, _MORE_OFTEN, 9, (0.0, 0.7916666666666667, 0.8333333333333333)),
    ],
)
def test_a_plan_of_the_version_that_had_only_bets_keeps_its_rule_and_its_words(
    about: str, method: str, words: str, beaten_at: int, numbers: tuple[float, float, float]
) -> None:
    path = Path(__file__).parents[1] / "data" / "study_of_bets.yaml"
    text = path.read_text(encoding="utf-8").replace("about: cells-like-these", f"about: {about}")
    study = parse_study(text, str(path))
    primary = analyse(study, standing(study, 12, lambda arm, _goal, start: arm == "one" or start % 5 == 0))
    (answer,) = primary.answers
    assert not study.by_looks
    assert primary.method == method
    assert (primary.over, dict(primary.dropped)) == ("the primary analysis is decided", {"two": beaten_at})
    assert (answer.p, answer.low, answer.high) == pytest.approx(numbers)
    assert conclusion(study, primary, SHOWN, None) == words


def test_equal_arms_are_rarely_told_apart() -> None:
    study = looked()
    design = design_of_study(study, 15, 0.5)
    arms = simulated_arms(np.random.default_rng(1), design, 0.0, samples=400)
    found = looked_studies(study, arms.mean(-1), 1, looks_of(study, 15))
    assert np.count_nonzero(found.signs) <= 32  # 8 %; expected are at most 5 %
