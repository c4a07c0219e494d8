"""Next step after an episode, by its end reason and the rules of its session."""

import pytest

from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.runner.loop.follow_up import FollowUp, FollowUpRules, VoidLimit, strands_robot


def ended(reason: EndReason, **fields: bool) -> EpisodeEnd:
    success = False if reason.is_result else None
    return EpisodeEnd(Verdict(reason, success, "text"), 1, None, 0.1, "the error", **fields)


@pytest.mark.parametrize(
    ("reasons", "stops"),
    [
        (["motion_failed"] * 3, True),
        (["motion_failed", "stop", "motion_failed", "motion_failed"], False),
        (["motion_failed", "aborted", "motion_failed"], False),
        (["motion_failed", "aborted", "motion_failed", "sensor_lost"], True),
        (["aborted"] * 5, False),
    ],
)
def test_three_consecutive_void_episodes_stop_a_session(reasons: list[str], stops: bool) -> None:
    limit = VoidLimit()
    assert [bool(limit.add(ended(EndReason(reason)))) for reason in reasons][-1] is stops


def test_a_served_model_lost_by_all_workers_at_once_counts_once() -> None:
    limit, lost = VoidLimit(), ended(EndReason.MODEL_LOST)
    assert [limit.add(lost, running) for running in (7, 7, 7, 7, 7, 7, 7, 7)] == [None] * 8
    assert limit.consecutive == 1
    assert limit.add(lost, 7) is None
    assert [limit.add(lost, 0) for _ in range(7)] == [None] * 7
    assert limit.add(lost, 7) is not None


def test_a_failing_model_in_several_workers_counts_each_time() -> None:
    limit = VoidLimit()
    assert [bool(limit.add(ended(EndReason.MODEL_ERROR), 7)) for _ in range(3)] == [False, False, True]


def test_fail_fast_stops_at_the_first_void_episode() -> None:
    assert VoidLimit(1).add(ended(EndReason.MODEL_ERROR)) == "an episode is void: the error"


@pytest.mark.parametrize("reason", list(EndReason))
def test_only_voids_of_the_operator_or_the_robot_repeat_at_once(reason: EndReason) -> None:
    repeats = reason in (EndReason.ABORTED, EndReason.MOTION_FAILED, EndReason.SENSOR_LOST)
    assert FollowUpRules(repeats_void_trials=True).after_episode(ended(reason)).repeats is repeats
    assert not FollowUpRules().after_episode(ended(reason)).repeats


def test_a_failing_model_is_reloaded_and_then_suspended_without_stopping_the_study() -> None:
    rules = FollowUpRules(isolates_models=True)
    failed, stopped = ended(EndReason.MODEL_ERROR), ended(EndReason.STOP)
    assert rules.after_episode(failed, "a") == FollowUp(reloads_model=True)
    assert rules.after_episode(stopped, "a") == FollowUp()
    assert [rules.after_episode(failed, "a").suspends_model for _ in range(3)] == [False, False, True]
    assert rules.after_episode(ended(EndReason.MODEL_ERROR, began=False), "b").suspends_model
    assert (rules.episodes, rules.void) == (6, 5)


def test_a_lost_worker_counts_until_an_episode_ends() -> None:
    rules = FollowUpRules()
    assert not any(rules.after_lost_worker("SIGKILL") for _ in range(9))
    rules.after_episode(ended(EndReason.STOP))
    assert [bool(rules.after_lost_worker("SIGKILL")) for _ in range(10)] == [*[False] * 9, True]


@pytest.mark.parametrize(
    ("reason", "proposed", "began", "strands"),
    [
        ("motion_failed", True, True, True),
        ("motion_failed", False, True, False),
        ("motion_failed", True, False, False),
        ("aborted", True, True, False),
    ],
)
def test_a_real_robot_is_stranded_where_it_failed(reason: str, proposed: bool, began: bool, strands: bool) -> None:
    assert strands_robot(ended(EndReason(reason), proposed=proposed, began=began)) is strands
