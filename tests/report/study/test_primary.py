from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.study.studies import small_study
from vsnbench.report.study.conclusion import conclusion
from vsnbench.report.study.primary import analyse, in_order
from vsnbench.results.studies.entries import StudyTrialProgress
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.lifecycle import EpisodeState
from vsnbench.statistics.clustered import Cell
from vsnbench.statistics.conclusion import Conclusion, DifferenceEvidence, conclude
from vsnbench.statistics.paired import PairedCell, PairedOutcomes, paired_interval, paired_test
from vsnbench.study.file import StudyFile
from vsnbench.study.schedule import draw_schedule

SHOWN = {"one": "arm B", "two": "arm A"}
Succeeds = Callable[[str, str, int], bool | None]


def standing(study: StudyFile, starts: int, succeeds: Succeeds) -> list[StudyTrialProgress]:
    """Return the outcomes of a study's trials, None for a remaining one."""
    found = []
    for one in draw_schedule(study, tuple(range(1, starts + 1))).trials:
        success = succeeds(one.arm, one.goal, one.start)
        trial = Trial(one.goal, one.start, one.repetition, id=one.rank + 1, campaign_id=1)
        state = None if success is None else EpisodeState.JUDGED
        found.append(StudyTrialProgress(one.rank, one.block, one.arm, trial, None, state, success, False, 0))
    return found


def concluded(study: StudyFile, starts: int, succeeds: Succeeds, changed_after: int | None = None) -> str:
    return conclusion(study, analyse(study, standing(study, starts, succeeds)), SHOWN, changed_after)


def test_better_is_said_of_whom_the_test_of_the_whole_plan_found_better() -> None:
    words = concluded(small_study(), 12, lambda arm, _goal, _start: arm == "one")
    assert words == "Arm B is better than arm A on the shared goals: 24 against 0 of 24 cells."


@pytest.mark.parametrize(
    ("succeeds", "words"),
    [
        (lambda arm, goal, start: start % 2 == 0, "o difference was shown"),
        (lambda arm, goal, start: arm == "one" and start == 1, "o difference was shown"),
        (lambda arm, goal, start: None if start == 12 and arm == "two" else arm == "one", "No conclusion yet"),
    ],
    ids=["alike", "one lucky position", "one trial is left"],
)
def test_better_is_never_said_without_the_test(succeeds: Succeeds, words: str) -> None:
    said = concluded(small_study(), 12, succeeds)
    assert words in said
    assert "better" not in said


def test_a_margin_must_be_beaten_by_the_interval() -> None:
    def lead(arm: str, goal: str, start: int) -> bool:
        return arm == "one" or start % 2 == 0

    assert "better" in concluded(small_study(), 16, lead)
    assert "better" not in concluded(small_study(margin=0.45), 16, lead)


def test_of_these_cells_nobody_is_better_only_ahead_in_the_trials() -> None:
    study = small_study(stopping="decided", about="these-cells")
    won = concluded(study, 12, lambda arm, _goal, _start: arm == "one")
    assert won.startswith("Arm B succeeded more often than arm A in this plan's trials: ")
    assert "; whether a model is better is not shown: " in won
    assert "is better than" not in won
    counted = concluded(study, 12, lambda arm, goal, start: (arm == "one") == (start % 2 == 0) or start == 1)
    assert "better" not in counted
    rate = small_study(stopping="decided", about="these-cells", primary={"kind": "rate", "arm": "one", "rate": 0.5})
    assert "in this plan's trials, more than 50%" in concluded(rate, 15, lambda arm, _goal, _start: arm == "one")


def test_a_lead_that_was_counted_has_no_p_value() -> None:
    study = small_study(stopping="decided", about="these-cells")
    (answer,) = analyse(study, standing(study, 1, lambda arm, _goal, _start: arm == "one")).answers
    assert (answer.counted, answer.p, answer.winner) == (True, None, None)


@pytest.mark.parametrize(
    ("starts", "said"),
    [
        (2, "(+100 points (too few starting positions for an interval))"),
        (3, "(+100 points [+21, +100]; the interval excludes 0, but the test does not reject equality, p = 0.250)"),
    ],
)
def test_of_few_starting_positions_no_interval_stands_alone(starts: int, said: str) -> None:
    study = small_study(goals=["chair"], starting_positions=f"1-{starts}")
    assert said in concluded(study, starts, lambda arm, _goal, _start: arm == "one")


def test_one_arm_against_a_rate() -> None:
    study = small_study(primary={"kind": "rate", "arm": "one", "rate": 0.5})
    assert "better than 50%" in concluded(study, 15, lambda arm, _goal, _start: arm == "one")
    assert "less than 50%" in concluded(study, 15, lambda arm, _goal, _start: arm == "two")
    assert "neither above nor below" in concluded(study, 15, lambda arm, _goal, start: start % 2 == 0)


def test_a_way_of_judging_that_was_changed_is_said_in_the_conclusion() -> None:
    assert concluded(small_study(), 12, lambda arm, _goal, _start: arm == "one", 7).endswith(
        "(the analysis was changed after 7 results)."
    )


def test_pairs_are_told_in_the_order_of_the_codes_and_not_of_the_file() -> None:
    study = small_study()
    primary = analyse(study, standing(study, 12, lambda arm, _goal, _start: arm == "one"))
    turned = in_order(primary, {"one": "B", "two": "A"}).answers[0]
    assert (turned.first, turned.second, turned.successes, turned.difference) == ("two", "one", (0, 24), -1.0)
    assert turned.low <= turned.difference <= turned.high
    assert turned.winner == "one"


def test_a_whole_plan_names_no_winner_while_its_interval_includes_0() -> None:
    # A model has the same rate everywhere, the other fails at few positions: only the test rejects.
    study = small_study(starting_positions="1-15", repetitions=5)
    trials = standing(study, 15, lambda arm, _goal, _start: True)
    missed = [one for one in trials if one.arm == "one" and one.trial.repetition == 1 and one.trial.goal == "bed"]
    trials = [replace(one, success=False) if one in missed else one for one in trials]
    primary = analyse(study, trials)
    (answer,) = primary.answers
    assert (answer.p, answer.successes) == (pytest.approx(2**-14), (135, 150))
    assert answer.low < 0 <= answer.high
    assert (answer.winner, answer.loser, answer.conclusion) == (None, None, Conclusion.TEST_ONLY)
    said = conclusion(study, primary, SHOWN, None)
    assert "better" not in said
    assert "the test rejects equality, but the interval includes 0, p < 0.001" in said


@pytest.mark.parametrize(("repetitions", "said"), [(1, "24 cells"), (2, "48 trials (24 cells x 2 repetitions)")])
def test_repetitions_of_a_cell_are_not_counted_as_cells(repetitions: int, said: str) -> None:
    study = small_study(repetitions=repetitions)
    words = concluded(study, 12, lambda arm, _goal, _start: arm == "one")
    assert words.endswith(f"{24 * repetitions} against 0 of {said}.")
    primary = analyse(study, standing(study, 12, lambda arm, _goal, _start: arm == "one"))
    assert (primary.cells, primary.trials) == (24, 24 * repetitions)


def test_few_starting_positions_decide_nothing_about_others_however_many_repetitions() -> None:
    # An arm is ahead at 5 of 8 positions and behind at 3, with the same outcome in each repetition.
    study = small_study(stopping="decided", about="cells-like-these", repetitions=20, starting_positions="1-8")

    def lead(arm: str, goal: str, start: int) -> bool:
        return (arm == "one") == (start > 3)

    primary = analyse(study, standing(study, 8, lead))
    (answer,) = primary.answers
    assert (answer.winner, answer.trials, answer.cells) == (None, 320, 16)
    assert answer.low < 0 < answer.high


def test_a_study_that_waits_for_a_starting_position_says_how_many_are_complete() -> None:
    study = small_study(stopping="decided", about="cells-like-these", starting_positions="1-12")
    trials = standing(study, 12, lambda arm, _goal, _start: arm == "one")
    some = [one if one.rank < 21 else replace(one, success=None) for one in trials]
    assert conclusion(study, analyse(study, some), SHOWN, None).startswith(
        "No conclusion yet: 5 of 12 starting positions are done by both"
    )


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    plan=st.sampled_from([("plan", None), ("decided", "these-cells"), ("decided", "cells-like-these")]),
    strengths=st.tuples(st.sampled_from([0.0, 1.0, 4.0]), st.sampled_from([0.0, 1.0, 4.0])),
    ahead=st.sampled_from([0.0, 1.0, 3.0]),
    repetitions=st.integers(1, 3),
)
def test_a_study_and_a_comparison_never_name_opposite_winners(
    seed: int, plan: tuple[str, str | None], strengths: tuple[float, float], ahead: float, repetitions: int
) -> None:
    study = small_study(stopping=plan[0], about=plan[1], repetitions=repetitions, starting_positions="1-12", seed=1)
    random = np.random.default_rng(seed)
    logits = {
        (arm, start): base + strength * random.standard_normal()
        for arm, strength, base in zip(study.arms, strengths, (ahead, 0.0), strict=True)
        for start in range(1, 13)
    }
    trials = standing(
        study, 12, lambda arm, _goal, start: bool(random.random() < 1 / (1 + np.exp(-logits[arm, start])))
    )
    (answer,) = analyse(study, trials).answers
    cells = sorted({(one.trial.goal, one.trial.start) for one in trials})
    won = Counter((one.arm, one.trial.goal, one.trial.start) for one in trials if one.success)
    outcomes = PairedOutcomes(
        tuple(
            PairedCell(*(Cell(start, won[arm, goal, start], repetitions) for arm in study.arms))
            for goal, start in cells
        )
    )
    evidence = DifferenceEvidence(outcomes.difference, paired_interval(outcomes), paired_test(outcomes))
    compared = {1: "one", -1: "two", 0: None}[conclude(evidence).sign]
    if plan[0] == "plan":
        assert answer.winner == compared
    elif answer.winner is not None:
        assert compared in (answer.winner, None)
