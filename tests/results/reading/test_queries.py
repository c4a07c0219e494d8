import pytest

from tests.results.records_of_a_lab import begun, forward, plan, run, stopped, void
from vsnbench.errors import UsageError
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import count_episodes, episode_record, list_campaigns, list_episodes
from vsnbench.results.writing.entries import EpisodeEnd, unjudged_end
from vsnbench.results.writing.journal import Journal


@pytest.fixture
def journal(url: str) -> Journal:
    """Six episodes: void, success, failure by collision, unjudged, running, and one of another campaign."""
    journal = Journal.open(url)
    chair_1, chair_2, sofa_1, sofa_2 = journal.find_or_create_campaign(plan()).trials
    run(journal, chair_1, void())
    run(journal, chair_1, stopped(success=True))
    collision = Verdict(EndReason.COLLISION, False, "failed: collision at action 3")
    run(journal, chair_2, EpisodeEnd(collision, 3))
    run(journal, sofa_1, unjudged_end(EndReason.STOP, 3))
    journal.append_step(begun(journal, sofa_2).id, forward(1))
    other = journal.find_or_create_campaign(plan(goals=("bed",), seed=8))
    run(journal, other.trials[0], stopped(success=False))
    return journal


@pytest.mark.parametrize(
    ("which", "found"),
    [
        (EpisodeFilter(), [1, 2, 3, 4, 5, 6]),
        (EpisodeFilter(outcome="success"), [2]),
        (EpisodeFilter(outcome="failure"), [3, 6]),
        (EpisodeFilter(outcome="void"), [1]),
        (EpisodeFilter(outcome="unjudged"), [4]),
        (EpisodeFilter(outcome="running"), [5]),
        (EpisodeFilter(outcome="collision"), [3]),
        (EpisodeFilter(goals=("chair",)), [1, 2, 3]),
        (EpisodeFilter(campaign="2"), [6]),
        (EpisodeFilter(models=("random", "oracle"), goals=("sofa",), outcome="unjudged"), [4]),
        (EpisodeFilter(models=("oracle",)), []),
        (EpisodeFilter(campaign="%"), []),
    ],
)
def test_a_filter_finds(journal: Journal, which: EpisodeFilter, found: list[int]) -> None:
    assert [episode.id for episode in list_episodes(journal.engine, which)] == found
    assert count_episodes(journal.engine, which) == len(found)


def test_every_episode_has_one_word_for_its_outcome(journal: Journal) -> None:
    outcomes = [episode.outcome for episode in list_episodes(journal.engine, EpisodeFilter())]
    assert outcomes == ["void", "success", "failure", "unjudged", "running", "failure"]


def test_a_limit_gives_the_latest_in_order(journal: Journal) -> None:
    assert [episode.id for episode in list_episodes(journal.engine, EpisodeFilter(), limit=2)] == [5, 6]


def test_the_first_judged_result_of_a_trial_counts(journal: Journal) -> None:
    assert [number for number in range(1, 7) if episode_record(journal.engine, number).counts] == [2, 3, 6]


def test_when_a_void_attempt_is_pardoned_the_first_result_of_the_trial_counts(journal: Journal) -> None:
    journal.judge(1, Verdict(EndReason.STOP, False, "it had stopped by itself"), author="ada")
    assert [number for number in range(1, 4) if episode_record(journal.engine, number).counts] == [1, 3]


def test_campaigns_say_how_far_they_have_come(journal: Journal) -> None:
    states = list_campaigns(journal.engine)
    assert [(state.seed, state.trials, state.done) for state in states] == [(7, 4, 3), (8, 2, 1)]


def test_a_collision_is_told_from_the_standing_verdict(journal: Journal) -> None:
    assert episode_record(journal.engine, 3).collision
    assert not episode_record(journal.engine, 2).collision
    journal.judge(2, Verdict(EndReason.COLLISION, False, "it brushed the door"), author="ada")
    assert episode_record(journal.engine, 2).collision


def test_an_episode_that_does_not_exist_is_a_mistake_of_the_command(journal: Journal) -> None:
    with pytest.raises(UsageError, match="episode 77"):
        episode_record(journal.engine, 77)
