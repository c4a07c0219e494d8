"""Campaigns that several processes create and extend concurrently."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Barrier

import pytest
from sqlalchemy import text

from tests.results.records_of_a_lab import begun, plan, run, stopped
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import list_episodes
from vsnbench.results.schema.engine import open_engine
from vsnbench.results.writing.campaigns import OpenCampaign, Trial
from vsnbench.results.writing.journal import Journal

PROCESSES = 6


def at_once(url: str, ask: "list[tuple[Trial, ...]]") -> list[OpenCampaign]:
    """Request each plan from its own journal, all at the same time."""
    journals = [Journal.open(url) for _ in ask]
    barrier = Barrier(len(ask))

    def create(journal: Journal, trials: tuple[Trial, ...]) -> OpenCampaign:
        barrier.wait(30)
        return journal.find_or_create_campaign(replace(plan(), trials=trials))

    with ThreadPoolExecutor(len(ask)) as pool:
        made = list(pool.map(create, journals, ask))
    for journal in journals:
        journal.close()
    return made


def test_those_who_create_one_campaign_at_once_get_one(url: str) -> None:
    made = at_once(url, [tuple(plan().trials)] * PROCESSES)
    assert len({campaign.id for campaign in made}) == 1
    assert len({campaign.trials for campaign in made}) == 1
    with open_engine(url).connect() as connection:
        for table in ("campaign", "site", "robot", "model"):
            assert connection.execute(text(f"SELECT count(*) FROM {table}")).scalar() == 1


def test_those_who_extend_one_plan_at_once_plan_every_trial_once(url: str) -> None:
    wanted = [tuple(Trial("chair", start) for start in range(1, last + 2)) for last in range(1, PROCESSES)]
    made = at_once(url, wanted)
    for campaign, trials in zip(made, wanted, strict=True):
        assert [(trial.goal, trial.start) for trial in campaign.trials] == [(t.goal, t.start) for t in trials]
    with open_engine(url).connect() as connection:
        ranks = connection.execute(text("SELECT rank FROM trial ORDER BY rank")).scalars().all()
    assert list(ranks) == list(range(PROCESSES))


def test_identical_trials_count_once_whatever_command_brought_them(url: str) -> None:
    with Journal.open(url) as journal:
        some = journal.find_or_create_campaign(replace(plan(), trials=plan().trials[:3]))
        for trial in some.trials:
            run(journal, trial, stopped(success=False))
        more = journal.find_or_create_campaign(plan())
        assert more.id == some.id
        assert [trial.id for trial in more.trials[:3]] == [trial.id for trial in some.trials]
        while (claim := journal.claim_next(more.id, [trial.id for trial in more.trials])) is not None:
            journal.release(claim.id)
            run(journal, claim.trial, stopped(success=False))
        assert len(list_episodes(journal.engine, EpisodeFilter())) == len(plan().trials)


def test_a_trial_that_somebody_is_at_cannot_be_written_twice_by_any_program(url: str) -> None:
    with Journal.open(url) as journal:
        episode = begun(journal, journal.find_or_create_campaign(plan()).trials[0])
        with pytest.raises(Exception, match=r"(?i)unique"), journal.engine.begin() as connection:
            connection.execute(
                text(
                    "INSERT INTO episode (uuid, trial_id, process_id, origin, state, seed, started_at, error, actions, "
                    "images_directory) SELECT 'another', trial_id, process_id, origin, 'claimed', seed, started_at, "
                    "'', 0, '' FROM episode WHERE id = :id"
                ),
                {"id": episode.id},
            )
