import os
import signal
from dataclasses import replace
from datetime import UTC, datetime, timedelta, tzinfo
from typing import TextIO

import pytest
from sqlalchemy import text

from tests.processes import Fork
from tests.results.records_of_a_lab import begun, finish, forward, plan, run, running_elsewhere, stopped
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import episode_record, episode_steps, list_campaigns, list_episodes
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.journal import Journal
from vsnbench.results.writing.provenance import ProcessIdentity, this_process
from vsnbench.results.writing.recovery import orphaned_episodes, recover_one
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.pose import Pose


def killed_in_mid_episode(url: str, steps: int) -> int:
    """Run an episode in another process, kill it after some steps, and return its last reported step."""
    with running_elsewhere(url) as process:
        reported = [int(process.stdout.readline()) for _ in range(steps)][-1]
        os.kill(process.pid, signal.SIGKILL)
        return max([reported, *map(int, process.stdout.read().split())])


def test_an_episode_of_a_killed_process_keeps_its_steps_and_its_trial_runs_again(url: str) -> None:
    reported = killed_in_mid_episode(url, 25)
    with Journal.open(url) as journal:
        (recovered,) = journal.recovered
        assert recovered.steps >= reported
        steps = episode_steps(journal.engine, recovered.id)
        assert [step.number for step in steps] == list(range(1, recovered.steps + 1))
        details = episode_record(journal.engine, recovered.id)
        assert (details.end_reason, details.outcome) == ("interrupted", "void")
        assert details.actions == recovered.steps
        assert details.path_m is not None
        assert abs(details.path_m - 0.25 * recovered.steps) < 1e-6
        assert not details.counts
        assert [event.kind for event in details.events] == ["recovered"]
        campaign = journal.find_or_create_campaign(plan())
        assert campaign.resumed
        assert journal.campaign_progress(campaign).left == campaign.trials
        for trial in journal.campaign_progress(campaign).left:
            run(journal, trial, stopped(success=True))
        assert journal.campaign_progress(campaign).left == ()


def test_recovery_happens_once(sqlite: str) -> None:
    killed_in_mid_episode(sqlite, 3)
    assert len(Journal.open(sqlite).recovered) == 1
    with Journal.open(sqlite) as journal:
        assert journal.recovered == ()
        assert len(episode_record(journal.engine, 1).verdicts) == 1


def test_the_episode_of_a_living_process_is_left_alone(url: str) -> None:
    with Journal.open(url) as first:
        trial = first.find_or_create_campaign(plan()).trials[0]
        episode = begun(first, trial)
        assert Journal.open(url).recovered == ()
        first.append_step(episode.id, forward(1))
        first.end_episode(episode.id, stopped(success=True))


def test_on_a_shared_server_another_machine_counts_as_dead_only_after_long_silence(postgresql: str) -> None:
    with Journal.open(postgresql) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        begun(journal, trial)
        with journal.engine.begin() as connection:
            connection.execute(text("UPDATE process SET boot_id = 'another kernel', host = 'another robot'"))
        assert journal.recover() == ()
        with journal.engine.begin() as connection:
            long_ago = datetime.now(UTC) - timedelta(hours=1)
            connection.execute(text("UPDATE episode SET lease_until = :then"), {"then": long_ago})
        assert len(journal.recover()) == 1


def test_a_file_written_under_another_kernel_was_written_by_the_dead(sqlite: str) -> None:
    with Journal.open(sqlite) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        begun(journal, trial)
        with journal.engine.begin() as connection:
            connection.execute(text("UPDATE process SET boot_id = 'before the power cut'"))
        assert len(journal.recover()) == 1


def test_claims_and_placements_of_a_dead_process_are_released(url: str) -> None:
    with Journal.open(url) as journal:
        campaign = journal.find_or_create_campaign(plan())
        claimed = journal.claim_next(campaign.id, [campaign.trials[0].id])
        placed = journal.claim_next(campaign.id, [campaign.trials[1].id])
        assert claimed is not None
        assert placed is not None
        journal.place(placed.id, Fix(Pose(1.0, 1.0, 0.0), PoseSource.SURVEYED))
        with journal.engine.begin() as connection:
            connection.execute(text("UPDATE process SET start_ticks = 1"))
        assert journal.recover() == ()
        assert list_episodes(journal.engine, EpisodeFilter()) == ()
        assert journal.campaign_progress(campaign).left == campaign.trials


def test_recovery_leaves_alone_what_was_closed_while_it_looked(url: str) -> None:
    with Journal.open(url) as journal:
        episode = begun(journal, journal.find_or_create_campaign(plan()).trials[0])
        with journal.engine.begin() as connection:
            connection.execute(text("UPDATE process SET start_ticks = 1"))
        with journal.engine.begin() as connection:
            (dead,) = orphaned_episodes(connection, this_process())
        journal.end_episode(episode.id, stopped(success=True))
        with journal.engine.begin() as connection:
            assert recover_one(connection, dead) is None
        details = episode_record(journal.engine, episode.id)
        assert [(verdict.success, verdict.source) for verdict in details.verdicts] == [(True, "protocol")]
        assert details.events == ()


def test_a_claim_elsewhere_holds_while_it_is_renewed(postgresql: str) -> None:
    with Journal.open(postgresql) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        episode = begun(journal, trial)
        long_ago = {"then": datetime.now(UTC) - timedelta(hours=1)}
        with journal.engine.begin() as connection:
            connection.execute(text("UPDATE process SET boot_id = 'another kernel', host = 'another robot'"))
            connection.execute(text("UPDATE episode SET lease_until = :then"), long_ago)
        assert journal.renew(episode.id)
        assert journal.recover() == ()
        with journal.engine.begin() as connection:
            connection.execute(text("UPDATE episode SET lease_until = :then"), long_ago)
        journal.append_step(episode.id, forward(1))  # each step renews the lease
        assert journal.recover() == ()
        with journal.engine.begin() as connection:
            connection.execute(text("UPDATE episode SET lease_until = :then"), long_ago)
        assert [one.id for one in journal.recover()] == [episode.id]
        assert not journal.renew(episode.id)


def test_leases_are_held_against_the_servers_clock_and_not_a_robots(
    postgresql: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Behind(datetime):
        """Return the time of a robot whose clock is an hour slow."""

        @classmethod
        def now(cls, tz: tzinfo | None = None) -> "datetime":  # type: ignore[override]
            return datetime.now(tz) - timedelta(hours=1)

    with Journal.open(postgresql) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        with monkeypatch.context() as patch:
            patch.setattr("vsnbench.results.writing.lifecycle.datetime", Behind)
            episode = begun(journal, trial)
            journal.append_step(episode.id, forward(1))
            assert journal.renew(episode.id)
        with journal.engine.begin() as connection:
            connection.execute(text("UPDATE process SET boot_id = 'another kernel', host = 'another robot'"))
            assert connection.execute(text("SELECT lease_until > now() FROM episode")).scalar_one()
        assert journal.recover() == ()


def test_a_process_is_told_from_a_later_one_with_the_same_number() -> None:
    here = this_process()
    assert here.is_alive(here) is True
    reborn = ProcessIdentity(here.host, here.pid, here.boot_id, here.pid_namespace, here.start_ticks - 1)
    assert reborn.is_alive(here) is False


def test_a_process_in_another_container_cannot_be_asked() -> None:
    here = this_process()
    elsewhere = ProcessIdentity(here.host, here.pid, here.boot_id, "pid:[1]", here.start_ticks)
    assert elsewhere.is_alive(here) is None


def driver(url: str) -> Fork:
    """Run 40 trials in another process, which writes the number of each claimed episode."""

    def drive(sink: TextIO) -> None:
        given = replace(plan(), trials=[Trial("chair", 1, repetition) for repetition in range(1, 41)])
        journal = Journal.open(url)
        campaign = journal.find_or_create_campaign(given)
        while (claim := journal.claim_next(campaign.id, [trial.id for trial in campaign.trials])) is not None:
            sink.write(f"{claim.id}\n")
            sink.flush()
            finish(journal, claim, stopped(success=True, actions=8), steps=8)

    return Fork.of(drive)


def test_three_killed_drivers_on_an_empty_record_run_every_trial_once(url: str) -> None:
    drivers = [driver(url) for _ in range(3)]
    for killed in drivers[:2]:
        for _ in range(4):
            assert killed.stdout.readline()
        killed.kill()
    drivers.append(last := driver(url))
    assert [drivers[2].wait(), last.wait()] == [0, 0]
    for one in drivers:
        one.stdout.close()
    with Journal.open(url) as journal:
        episodes = list_episodes(journal.engine, EpisodeFilter())
        assert len(list_campaigns(journal.engine)) == 1
        assert all(len(episode_steps(journal.engine, one.id)) == one.actions for one in episodes)
    done = [(one.goal, one.repetition) for one in episodes if one.success]
    assert sorted(done) == [("chair", repetition) for repetition in range(1, 41)]
    assert {one.outcome for one in episodes} <= {"success", "void"}
