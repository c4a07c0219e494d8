import math
import os
import statistics
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import update

from tests.results.records_of_a_lab import begun, cell, finish, forward, plan, run, stopped, void
from vsnbench.errors import EpisodeClosedError, RecordError, UsageError
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import episode_record, episode_steps, list_episodes
from vsnbench.results.schema.engine import open_engine
from vsnbench.results.schema.tables import StepRow
from vsnbench.results.writing.campaigns import CampaignPlan, Trial, trial_seed
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd, unjudged_end
from vsnbench.results.writing.journal import Journal
from vsnbench.values.fix import PoseSource
from vsnbench.values.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.values.movement import Action
from vsnbench.values.step import StepRecord


def test_the_same_plan_finds_its_campaign_again_with_the_trials_that_are_left(url: str) -> None:
    with Journal.open(url) as journal:
        campaign = journal.find_or_create_campaign(plan())
        assert not campaign.resumed
        assert [(trial.goal, trial.start) for trial in campaign.trials] == [
            ("chair", 1), ("chair", 2), ("sofa", 1), ("sofa", 2),
        ]  # fmt: skip
        run(journal, campaign.trials[0], stopped(success=True))
        run(journal, campaign.trials[1], stopped(success=False))
        run(journal, campaign.trials[2], void())
    with Journal.open(url) as journal:
        again = journal.find_or_create_campaign(plan())
        assert again.resumed
        assert again.trials == campaign.trials
        assert journal.campaign_progress(again).left == campaign.trials[2:]


def other_protocol(given: CampaignPlan) -> CampaignPlan:
    return replace(given, protocol=ProtocolParameters(max_actions=149))


@pytest.mark.parametrize(
    "change",
    [
        lambda given: replace(given, seed=8),
        lambda given: replace(given, conditions={"noise": {"odometry": 0.01}}),
        lambda given: replace(given, model=replace(given.model, settings={"temperature": 0.5})),
        lambda given: replace(given, model=replace(given.model, weights_sha256="f" * 64)),
        lambda given: replace(given, model=replace(given.model, files={"model_config": "f" * 64})),
        lambda given: replace(given, model=replace(given.model, code={"source_sha256": "f" * 64})),
        lambda given: replace(given, robot=replace(given.robot, kind="ros1")),
        lambda given: replace(given, robot=replace(given.robot, simulated=False)),
        lambda given: replace(given, site=cell().model_copy(update={"title": "Another cell"})),
        other_protocol,
    ],
)
def test_whatever_could_change_a_result_makes_another_campaign(change: object) -> None:
    assert callable(change)
    assert change(plan()).key != plan().key


def test_names_and_the_trials_that_are_asked_for_do_not_make_another_campaign() -> None:
    given = plan()
    assert replace(given, trials=list(reversed(given.trials)), name="Tuesday").key == given.key
    assert replace(given, trials=[*given.trials, Trial("chair", 1, 2)]).key == given.key


def test_a_later_command_extends_the_plan_and_done_trials_stay_done(url: str) -> None:
    with Journal.open(url) as journal:
        first = journal.find_or_create_campaign(plan(goals=("chair",)))
        run(journal, first.trials[0], stopped(success=True))
        more = journal.find_or_create_campaign(plan(goals=("sofa", "chair")))
        assert (more.id, more.resumed) == (first.id, True)
        assert [(trial.goal, trial.start) for trial in more.trials] == [
            ("sofa", 1), ("sofa", 2), ("chair", 1), ("chair", 2),
        ]  # fmt: skip
        assert [(trial.goal, trial.start) for trial in journal.campaign_progress(more).left] == [
            ("sofa", 1), ("sofa", 2), ("chair", 2),
        ]  # fmt: skip
        fewer = journal.find_or_create_campaign(plan(goals=("chair",)))
        assert fewer.trials == first.trials


def test_trials_are_claimed_in_the_order_that_is_asked_for_now(url: str) -> None:
    with Journal.open(url) as journal:
        campaign = journal.find_or_create_campaign(plan())
        backwards = journal.find_or_create_campaign(replace(plan(), trials=list(reversed(plan().trials))))
        assert backwards.trials == tuple(reversed(campaign.trials))
        claim = journal.claim_next(backwards.id, [trial.id for trial in backwards.trials])
        assert claim is not None
        assert claim.trial == campaign.trials[-1]
        assert claim.seed == trial_seed(7, "sofa", 2, 1)


def test_a_plan_without_trials_or_with_one_twice_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one"):
        replace(plan(), trials=[])
    with pytest.raises(ValueError, match="twice"):
        replace(plan(), trials=[Trial("chair", 1), Trial("chair", 1)])


def test_a_trial_that_somebody_is_at_or_has_done_is_not_claimed_again(url: str) -> None:
    with Journal.open(url) as journal, Journal.open(url) as elsewhere:
        campaign = journal.find_or_create_campaign(plan())
        trial = campaign.trials[0]
        episode = begun(journal, trial)
        assert elsewhere.claim_next(campaign.id, [trial.id]) is None
        (at_it,) = elsewhere.campaign_progress(campaign).elsewhere
        assert (at_it.trial, at_it.episode_id, at_it.state) == (trial, episode.id, "running")
        assert journal.campaign_progress(campaign).elsewhere == ()
        journal.end_episode(episode.id, stopped(success=False))
        assert elsewhere.claim_next(campaign.id, [trial.id]) is None
        assert elsewhere.campaign_progress(campaign).elsewhere == ()


def test_a_void_attempt_or_a_result_made_void_leaves_its_trial_open(url: str) -> None:
    with Journal.open(url) as journal:
        campaign = journal.find_or_create_campaign(plan(goals=("chair",)))
        trial = campaign.trials[0]
        run(journal, trial, void(EndReason.MOTION_FAILED))
        second = run(journal, trial, stopped(success=True))
        assert trial not in journal.campaign_progress(campaign).left
        journal.judge(second.id, Verdict(EndReason.ABORTED, None, "the cat stood in the way"), author="ada")
        assert trial in journal.campaign_progress(campaign).left
        run(journal, trial, stopped(success=False))
        assert trial not in journal.campaign_progress(campaign).left


def test_an_episode_that_awaits_a_persons_word_is_not_run_again(url: str) -> None:
    with Journal.open(url) as journal:
        campaign = journal.find_or_create_campaign(plan(goals=("chair",)))
        run(journal, campaign.trials[0], unjudged_end(EndReason.STOP, 3))
        assert journal.campaign_progress(campaign).left == campaign.trials[1:]


def test_verdicts_are_only_added_and_the_latest_stands(url: str) -> None:
    with Journal.open(url) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        episode = run(journal, trial, stopped(success=True))
        tape = GoalDistance(1.2, PoseSource.TAPE, "chair_1")
        journal.judge(episode.id, Verdict(EndReason.STOP, False, "tape says 1.20 m", tape), author="ada")
        details = episode_record(journal.engine, episode.id)
    assert [verdict.success for verdict in details.verdicts] == [True, False]
    assert details.verdicts[1].author == "ada"
    assert details.success is False
    assert (details.distance_m, details.distance_source) == (1.2, "tape")


def test_whether_the_goal_was_in_sight_is_kept_with_the_distance(url: str) -> None:
    with Journal.open(url) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        hidden = GoalDistance(0.6, PoseSource.SIMULATED, "chair_1", in_sight=False)
        end = stopped(success=False)
        verdict = Verdict(EndReason.STOP, False, "failed: behind a wall", hidden)
        episode = run(journal, trial, replace(end, verdict=verdict))
        details = episode_record(journal.engine, episode.id)
    assert [given.goal_in_sight for given in details.verdicts] == [False]


def test_a_verdict_needs_an_episode_that_has_ended(url: str) -> None:
    with Journal.open(url) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        episode = begun(journal, trial)
        verdict = Verdict(EndReason.COLLISION, False, "it touched the table")
        with pytest.raises(EpisodeClosedError, match="cannot be judged yet: it is running by process"):
            journal.judge(episode.id, verdict, author="ada")
        with pytest.raises(UsageError, match="episode 999"):
            journal.judge(999, verdict, author="ada")


def test_an_episode_ends_once(url: str) -> None:
    with Journal.open(url) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        episode = run(journal, trial, stopped(success=True))
        with pytest.raises(EpisodeClosedError, match="has already ended"):
            journal.end_episode(episode.id, stopped(success=False))
        assert len(episode_record(journal.engine, episode.id).verdicts) == 1


def test_a_step_is_refused_where_the_episode_does_not_run(url: str) -> None:
    with Journal.open(url) as journal, Journal.open(url) as other:
        campaign = journal.find_or_create_campaign(plan())
        claim = journal.claim_next(campaign.id, [campaign.trials[0].id])
        assert claim is not None
        with pytest.raises(EpisodeClosedError, match="is not running in this process"):
            journal.append_step(claim.id, forward(1))
        journal.release(claim.id)
        episode = run(journal, campaign.trials[0], void())
        with pytest.raises(EpisodeClosedError, match="step 4 was not recorded"):
            journal.append_step(episode.id, forward(4))
        episode = begun(journal, campaign.trials[1])
        with pytest.raises(EpisodeClosedError, match="is not running in this process"):
            other.append_step(episode.id, forward(1))
        journal.append_step(episode.id, forward(1))


def test_an_episode_begins_only_where_its_robot_has_been_placed(url: str) -> None:
    with Journal.open(url) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        claim = journal.claim_next(trial.campaign_id, [trial.id])
        assert claim is not None
        with pytest.raises(EpisodeClosedError, match="it is claimed by process"):
            journal.begin(claim.id, EpisodeBegin())


def test_a_claim_that_never_began_is_released_or_voided_with_its_reason(url: str) -> None:
    with Journal.open(url) as journal:
        campaign = journal.find_or_create_campaign(plan())
        claim = journal.claim_next(campaign.id, [campaign.trials[0].id])
        assert claim is not None
        journal.add_event("placing", "the base did not answer", episode_id=claim.id)
        assert journal.release(claim.id)
        assert not journal.release(claim.id)
        assert list_episodes(journal.engine, EpisodeFilter()) == ()
        claim = journal.claim_next(campaign.id, [campaign.trials[0].id])
        assert claim is not None
        unbegun = Verdict(EndReason.MOTION_FAILED, None, "void: the base could not carry out an action")
        journal.end_episode(claim.id, EpisodeEnd(unbegun, 0, error="it stands on the cable"))
        assert episode_record(journal.engine, claim.id).error == "it stands on the cable"
        assert journal.campaign_progress(campaign).left == campaign.trials


def test_a_proposal_waits_for_a_person_and_never_stands(url: str) -> None:
    with Journal.open(url) as journal:
        campaign = journal.find_or_create_campaign(plan())
        trial = campaign.trials[0]
        episode = run(journal, trial, replace(stopped(success=True), proposed=True))
        details = episode_record(journal.engine, episode.id)
        assert (details.outcome, details.success) == ("unjudged", None)
        assert [(one.proposed, one.success) for one in details.verdicts] == [(True, True)]
        assert [one.trial for one in journal.campaign_progress(campaign).awaiting] == [trial]
        assert trial not in journal.campaign_progress(campaign).left
        journal.judge(episode.id, Verdict(EndReason.STOP, False, "tape says 1.20 m"), author="ada", note="twice")
        details = episode_record(journal.engine, episode.id)
        assert details.outcome == "failure"
        assert (details.verdicts[1].author, details.verdicts[1].note) == ("ada", "twice")


def test_a_step_comes_back_as_it_was_written(url: str) -> None:
    collision = MotionResult(
        False, 0.11, 0.02, 0.9, Collision(CollisionSource.BUMPER, "table_1"), "bumper", 2, forward(2).observed
    )
    strange = {
        "array": np.arange(3),
        "nan": math.nan,
        "half": np.float32(0.5),
        "nul": "a\x00b",
        "deep": [{"inf": math.inf}],
    }
    with Journal.open(url) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        episode = begun(journal, trial)
        journal.append_step(episode.id, forward(1))
        journal.append_step(episode.id, StepRecord(2, Action.MOVE_FORWARD, observed=forward(2).observed))
        journal.append_step(episode.id, replace(forward(3), result=collision, details=strange))
        first, blocked, third = episode_steps(journal.engine, episode.id)
    assert first.recorded_at is not None
    refused = StepRecord(2, Action.MOVE_FORWARD, "MOVE_FORWARD", observed=forward(2).observed)
    assert [replace(step, recorded_at=None) for step in (first, blocked)] == [forward(1), refused]
    assert (blocked.blocked, blocked.after) == (True, blocked.observed)
    assert third.result == collision
    assert third.details == {"array": [0, 1, 2], "nan": None, "half": 0.5, "nul": "a\ufffdb", "deep": [{"inf": None}]}


def test_a_step_that_is_none_is_told_by_its_number(url: str) -> None:
    with Journal.open(url) as journal:
        episode = begun(journal, journal.find_or_create_campaign(plan()).trials[0])
        journal.append_step(episode.id, forward(1))
        with journal.engine.begin() as connection:
            connection.execute(update(StepRow).values(action="FLY"))
        with pytest.raises(RecordError, match=r"episode 1, step 1: 'FLY' is not a valid Action; the record is damaged"):
            episode_steps(journal.engine, episode.id)


def test_a_step_twice_is_our_own_mistake(url: str) -> None:
    with Journal.open(url) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        episode = begun(journal, trial)
        journal.append_step(episode.id, forward(1))
        with pytest.raises(Exception, match=r"(?i)constraint") as caught:
            journal.append_step(episode.id, forward(1))
        assert not isinstance(caught.value, RecordError)


def test_times_come_back_aware_and_in_utc(url: str) -> None:
    with Journal.open(url) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        run(journal, trial, stopped(success=True))
        (episode,) = list_episodes(journal.engine, EpisodeFilter())
    assert episode.started_at.utcoffset() is not None
    assert abs(episode.started_at.timestamp() - time.time()) < 60


def test_two_writers_at_once_lose_nothing_and_share_the_trials(url: str) -> None:
    campaign = Journal.open(url).find_or_create_campaign(plan())

    def work(_: int) -> int:
        done = 0
        with Journal.open(url) as journal:
            while (claim := journal.claim_next(campaign.id, [trial.id for trial in campaign.trials])) is not None:
                finish(journal, claim, stopped(success=True, actions=30), steps=30)
                done += 1
        return done

    with ThreadPoolExecutor(4) as pool:
        assert sum(pool.map(work, range(4))) == len(campaign.trials)
    engine = open_engine(url)
    episodes = list_episodes(engine, EpisodeFilter())
    assert sorted((episode.goal, episode.start) for episode in episodes) == sorted(
        (trial.goal, trial.start) for trial in campaign.trials
    )
    assert all(len(episode_steps(engine, episode.id)) == 30 for episode in episodes)


def test_a_reader_does_not_wait_for_a_writer(sqlite: str) -> None:
    with Journal.open(sqlite) as journal:
        campaign = journal.find_or_create_campaign(plan())
        with journal.engine.begin():  # holds the write lock
            assert len(journal.campaign_progress(campaign).left) == 4
            assert list_episodes(journal.engine, EpisodeFilter()) == ()


def test_a_committed_step_costs_little(sqlite: str, capsys: pytest.CaptureFixture[str]) -> None:
    seconds = []
    with Journal.open(sqlite) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        episode = begun(journal, trial)
        for number in range(1, 1001):
            step = forward(number)
            begin = time.perf_counter()
            journal.append_step(episode.id, step)
            seconds.append(time.perf_counter() - begin)
    median_ms, worst_ms = statistics.median(seconds) * 1000, max(seconds) * 1000
    with capsys.disabled():
        print(f"\nappend_step: median {median_ms:.2f} ms, worst {worst_ms:.1f} ms")
    assert median_ms < 2


def test_provenance_names_the_process_and_its_code(sqlite: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VSNBENCH_OPERATOR", "ada")
    with Journal.open(sqlite) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        given = episode_record(journal.engine, run(journal, trial, stopped(success=True)).id).provenance
    assert given.operator == "ada"
    assert given.packages["sqlalchemy"]
    assert given.model_settings == {"temperature": 1.0}
    assert given.protocol["max_actions"] == 150
    assert given.site_content["name"] == "cell"
    if Path(__file__).parents[3].joinpath(".git").exists() and os.access("/usr/bin/git", os.X_OK):
        assert len(given.git_commit) == 40
