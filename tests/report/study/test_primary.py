from collections.abc import Callable

import pytest

from tests.study.studies import small_study
from vsnbench.database.campaign_plan import Trial
from vsnbench.database.lifecycle import EpisodeState
from vsnbench.database.study_entries import StudyTrialStanding
from vsnbench.report.study.primary import analyse, conclusion, in_order
from vsnbench.study.file import StudyFile
from vsnbench.study.schedule import draw_schedule

SHOWN = {"one": "arm B", "two": "arm A"}
Succeeds = Callable[[str, str, int], bool | None]


def standing(study: StudyFile, starts: int, succeeds: Succeeds) -> list[StudyTrialStanding]:
    """Return what became of a study's trials; None for one that is left."""
    found = []
    for one in draw_schedule(study, tuple(range(1, starts + 1))).trials:
        success = succeeds(one.arm, one.goal, one.start)
        trial = Trial(one.rank + 1, 1, one.goal, one.start, one.repetition)
        state = None if success is None else EpisodeState.JUDGED
        found.append(StudyTrialStanding(one.rank, one.block, one.arm, trial, None, state, success, False, 0))
    return found


def concluded(study: StudyFile, starts: int, succeeds: Succeeds, changed_after: int | None = None) -> str:
    return conclusion(study, analyse(study, standing(study, starts, succeeds)), SHOWN, changed_after)


def test_better_is_said_of_whom_the_test_of_the_whole_plan_found_better() -> None:
    words = concluded(small_study(), 12, lambda arm, _goal, _start: arm == "one")
    assert words == "Arm B is better than arm A on the shared goals: 24 against 0 of 24 cells."


@pytest.mark.parametrize(
    ("succeeds", "words"),
    [
        (lambda arm, goal, start: start % 2 == 0, "no difference was shown"),
        (lambda arm, goal, start: arm == "one" and start == 1, "no difference was shown"),
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


def test_of_these_cells_a_bet_that_was_won_says_better_and_a_counted_lead_does_not() -> None:
    study = small_study(stopping="decided", about="these-cells")
    assert "is better than arm A on these cells" in concluded(study, 12, lambda arm, _goal, _start: arm == "one")
    counted = concluded(study, 12, lambda arm, goal, start: (arm == "one") == (start % 2 == 0) or start == 1)
    assert "better" not in counted


@pytest.mark.parametrize(
    ("starts", "said"),
    [
        (2, "(+100 points (too few starting positions for an interval)), which"),
        (3, "(+100 points [+21, +100]; the test decides, p = 0.250), which"),
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
        "(the way of judging was changed after 7 results)."
    )


def test_pairs_are_told_in_the_order_of_the_codes_and_not_of_the_file() -> None:
    study = small_study()
    primary = analyse(study, standing(study, 12, lambda arm, _goal, _start: arm == "one"))
    turned = in_order(primary, {"one": "B", "two": "A"}).answers[0]
    assert (turned.first, turned.second, turned.successes, turned.difference) == ("two", "one", (0, 24), -1.0)
    assert turned.low <= turned.difference <= turned.high
    assert turned.winner == "one"
