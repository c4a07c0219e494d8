"""Goals, starts, sites and the trials that follow from them."""

import pytest

from vsnbench.errors import UsageError
from vsnbench.models.contract import ModelCard
from vsnbench.results.writing.campaigns import trial_seed
from vsnbench.runner.setup.selection import choose_goals, choose_starts, plan_trials, resolve_goals
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.site import load_site

APARTMENT = load_site("apartment")
ANY = ModelCard("any")
PAPERS_VLV = ModelCard("vlv", goals=frozenset({"chair", "sofa", "table", "bed", "toilet"}))


GOALS, STARTS = ("chair", "bed"), (1, 2, 3)


def test_every_goal_meets_every_start_in_every_repetition_once() -> None:
    trials = plan_trials(GOALS, STARTS, 2)
    assert len(trials) == len(set(trials)) == 12


def test_every_trial_has_its_own_constant_seed() -> None:
    trials = plan_trials(GOALS, STARTS, 2)
    seeds = [trial_seed(5, trial.goal, trial.start, trial.repetition) for trial in trials]
    assert len(set(seeds)) == len(seeds)
    assert trial_seed(0, "chair", 1, 1) == 1396812000


def test_all_goals_are_the_sites_goals_that_the_model_knows() -> None:
    assert choose_goals(["all"], APARTMENT, ANY) == GOAL_CATEGORIES
    assert choose_goals(["all"], APARTMENT, PAPERS_VLV) == ("chair", "sofa", "table", "bed", "toilet")


def test_goals_may_come_separated_by_commas_and_twice() -> None:
    assert resolve_goals(["bed,chair", "bed"], APARTMENT) == ("bed", "chair")


@pytest.mark.parametrize(
    ("asked", "goal"),
    [("couch", "sofa"), ("potted plant", "plant"), ("tv_monitor", "monitor"), ("refrigerator", "refrigerator")],
)
def test_other_names_and_other_categories_of_the_site_are_goals(asked: str, goal: str) -> None:
    assert resolve_goals([asked], APARTMENT) == (goal,)


@pytest.mark.parametrize(
    ("asked", "card", "code", "advice"),
    [
        ("kettle", ANY, "unknown-goal", "chair, sofa"),
        ("toillet", ANY, "unknown-goal", "'toilet'"),
        ("fridge", ANY, "unknown-goal", "'refrigerator'"),
        ("plant", PAPERS_VLV, "unknown-goal", ""),
        ("", ANY, "no-goal", "--goal"),
    ],
)
def test_an_invalid_goal_is_refused_with_the_valid_ones(asked: str, card: ModelCard, code: str, advice: str) -> None:
    with pytest.raises(UsageError) as refused:
        choose_goals(resolve_goals([asked], APARTMENT), APARTMENT, card)
    assert refused.value.code == code
    assert advice in refused.value.advice


def test_a_goal_the_site_lacks_is_refused() -> None:
    bare = APARTMENT.model_copy(update={"objects": APARTMENT.instances("chair")})
    with pytest.raises(UsageError) as refused:
        resolve_goals(["bed"], bare)
    assert (refused.value.code, refused.value.advice) == ("unknown-goal", "it has chair")


def test_starts_are_numbers_and_ranges() -> None:
    assert choose_starts(None, APARTMENT) == tuple(range(1, 16))
    assert choose_starts("1-3,7, 2", APARTMENT) == (1, 2, 3, 7)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ("1-15,20", "starting position 20 is not in site"),
        ("0", "starting position 0 is not in site"),
        ("one", "cannot read 'one'"),
        ("3-1", "3-1 in --starts 3-1 is empty"),
        ("-3", "cannot read '-3'"),
        ("", "cannot read"),
        ("1-999999999999", "starting position 999999999999 is not in site"),
    ],
)
def test_invalid_starts_are_refused(asked: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        choose_starts(asked, APARTMENT)


def test_excluded_goals_are_not_trials() -> None:
    trials = plan_trials(GOALS, STARTS, 2, excluded={(GOALS[0], STARTS[0])})
    assert len(trials) == 2 * (len(GOALS) * len(STARTS) - 1)
    assert all((trial.goal, trial.start) != (GOALS[0], STARTS[0]) for trial in trials)
    with pytest.raises(UsageError, match="not_for"):
        plan_trials(GOALS[:1], STARTS[:1], 1, excluded={(GOALS[0], STARTS[0])})
