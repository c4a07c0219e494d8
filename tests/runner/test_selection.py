"""What may be asked for, and the trials that it makes: sites, starts, goals, order."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.database.campaign_plan import trial_seed
from vsnbench.errors import UsageError
from vsnbench.models.contract import ModelCard
from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.protocol.site import load_site
from vsnbench.runner.selection import choose_goals, choose_starts, plan_trials

APARTMENT = load_site("apartment")
ANY = ModelCard("any")
PAPERS_VLV = ModelCard("vlv", goals=frozenset({"chair", "sofa", "table", "bed", "toilet"}))


GOALS, STARTS = ("chair", "bed"), (1, 2, 3)


def test_every_goal_meets_every_start_in_every_repetition_once() -> None:
    trials = plan_trials(GOALS, STARTS, 2)
    assert len(trials) == len(set(trials)) == 12


@given(seed=st.integers(0, 2**32))
def test_a_shuffle_keeps_the_trials_and_follows_from_the_seed(seed: int) -> None:
    shuffled = plan_trials(GOALS, STARTS, 1, seed)
    assert set(shuffled) == set(plan_trials(GOALS, STARTS, 1))
    assert shuffled == plan_trials(GOALS, STARTS, 1, seed)


def test_two_seeds_shuffle_differently() -> None:
    assert plan_trials(GOALS, STARTS, 1, 1) != plan_trials(GOALS, STARTS, 1, 2)


def test_a_trial_shares_its_seed_with_no_other_and_keeps_it() -> None:
    trials = plan_trials(GOALS, STARTS, 2)
    seeds = [trial_seed(5, trial.goal, trial.start, trial.repetition) for trial in trials]
    assert len(set(seeds)) == len(seeds)
    assert trial_seed(0, "chair", 1, 1) == 1396812000


def test_all_goals_are_those_of_the_site_that_the_model_knows_in_the_papers_order() -> None:
    assert choose_goals(["all"], APARTMENT, ANY) == GOAL_CATEGORIES
    assert choose_goals(["all"], APARTMENT, PAPERS_VLV) == ("chair", "sofa", "table", "bed", "toilet")


def test_goals_may_come_separated_by_commas_and_twice() -> None:
    assert choose_goals(["bed,chair", "bed"], APARTMENT, ANY) == ("bed", "chair")


@pytest.mark.parametrize(
    ("asked", "card", "words"),
    [
        ("kettle", ANY, "no goal category 'kettle'; there are chair"),
        ("couch", ANY, "no goal category 'couch'; write sofa; there are chair"),
        ("toillet", ANY, r"no goal category 'toillet'; did you mean toilet\? there are chair"),
        ("plant", PAPERS_VLV, "vlv does not know plant; it knows bed, chair"),
        ("", ANY, "no goal given"),
    ],
)
def test_a_goal_that_cannot_be_is_refused_with_those_that_can(asked: str, card: ModelCard, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        choose_goals([asked], APARTMENT, card)


def test_a_goal_the_site_lacks_is_refused() -> None:
    bare = APARTMENT.model_copy(update={"objects": APARTMENT.instances("chair")})
    with pytest.raises(UsageError, match="has no bed; it has chair"):
        choose_goals(["bed"], bare, ANY)


def test_starts_are_numbers_and_ranges() -> None:
    assert choose_starts(None, APARTMENT) == tuple(range(1, 16))
    assert choose_starts("1-3,7, 2", APARTMENT) == (1, 2, 3, 7)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ("1-15,20", "no starting position 20"),
        ("0", "no starting position 0"),
        ("one", "cannot read 'one'"),
        ("3-1", "3-1 in --starts 3-1 is empty"),
        ("-3", "cannot read '-3'"),
        ("", "cannot read"),
        ("1-999999999999", "no starting position 999999999999"),
    ],
)
def test_starts_that_cannot_be_are_refused(asked: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        choose_starts(asked, APARTMENT)


def test_goals_that_a_start_excludes_are_no_trials() -> None:
    trials = plan_trials(GOALS, STARTS, 2, excluded={(GOALS[0], STARTS[0])})
    assert len(trials) == 2 * (len(GOALS) * len(STARTS) - 1)
    assert all((trial.goal, trial.start) != (GOALS[0], STARTS[0]) for trial in trials)
    with pytest.raises(UsageError, match="not_for"):
        plan_trials(GOALS[:1], STARTS[:1], 1, excluded={(GOALS[0], STARTS[0])})
