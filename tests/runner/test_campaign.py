"""The plan of a campaign: trials, order, seeds, and what may be asked for."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.errors import UsageError
from vsnbench.models.contract import ModelCard
from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import load_site
from vsnbench.runner.campaign import CampaignPlan, choose_goals, choose_starts

APARTMENT = load_site("apartment")
ANY = ModelCard("any")
PAPERS_VLV = ModelCard("vlv", goals=frozenset({"chair", "sofa", "table", "bed", "toilet"}))


def plan(seed: int = 0, *, shuffled: bool = False, repetitions: int = 1) -> CampaignPlan:
    return CampaignPlan(
        APARTMENT, ProtocolParameters(), ("chair", "bed"), (1, 2, 3), repetitions, seed, shuffled=shuffled
    )


def test_every_goal_meets_every_start_in_every_repetition_once() -> None:
    trials = plan(repetitions=2).trials()
    assert len(trials) == len(set(trials)) == 12


@given(seed=st.integers(0, 2**32))
def test_a_shuffle_keeps_the_trials_and_follows_from_the_seed(seed: int) -> None:
    shuffled = plan(seed, shuffled=True)
    assert set(shuffled.trials()) == set(plan().trials())
    assert shuffled.trials() == plan(seed, shuffled=True).trials()


def test_two_seeds_shuffle_differently() -> None:
    assert plan(1, shuffled=True).trials() != plan(2, shuffled=True).trials()


def test_a_trial_keeps_its_seed_in_any_order_and_shares_it_with_no_other() -> None:
    ordered, shuffled = plan(5), plan(5, shuffled=True)
    seeds = [ordered.trial_seed(trial) for trial in ordered.trials()]
    assert [shuffled.trial_seed(trial) for trial in ordered.trials()] == seeds
    assert len(set(seeds)) == len(seeds)


def test_all_goals_are_those_of_the_site_that_the_model_knows_in_the_papers_order() -> None:
    assert choose_goals(["all"], APARTMENT, ANY) == GOAL_CATEGORIES
    assert choose_goals(["all"], APARTMENT, PAPERS_VLV) == ("chair", "sofa", "table", "bed", "toilet")


def test_goals_may_come_separated_by_commas_and_twice() -> None:
    assert choose_goals(["bed,chair", "bed"], APARTMENT, ANY) == ("bed", "chair")


@pytest.mark.parametrize(
    ("asked", "card", "words"),
    [
        ("kettle", ANY, "no goal category 'kettle'; there are chair"),
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
