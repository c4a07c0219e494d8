"""Writing a step renews its lease, and is refused in an episode of another process."""

from dataclasses import replace
from datetime import timedelta

import pytest
from sqlalchemy import Engine, text

from tests.results.records_of_a_lab import begun, forward, plan
from vsnbench.errors import EpisodeClosedError
from vsnbench.results.reading.queries import episode_steps
from vsnbench.results.writing import steps
from vsnbench.results.writing.journal import Journal
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action, Pixel, Trajectory
from vsnbench.values.pose import Pose
from vsnbench.values.step import AnswerTiming


def test_a_step_renews_a_partly_used_lease_and_is_refused_after_a_takeover(
    sqlite: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lease_until(engine: Engine) -> str:
        with engine.connect() as connection:
            return str(connection.execute(text("SELECT lease_until FROM episode")).scalar_one())

    with Journal.open(sqlite) as journal:
        episode = begun(journal, journal.find_or_create_campaign(plan()).trials[0])
        journal.append_step(episode.id, forward(1))
        renewed = lease_until(journal.engine)
        journal.append_step(episode.id, forward(2))
        assert lease_until(journal.engine) == renewed, "the lease has only begun"
        monkeypatch.setattr(steps, "RENEWED_AFTER", timedelta(0))
        journal.append_step(episode.id, forward(3))
        assert lease_until(journal.engine) > renewed
        monkeypatch.undo()
        with Journal.open(sqlite) as other, other.engine.begin() as connection:
            connection.execute(text("UPDATE episode SET process_id = process_id + 1"))
        with pytest.raises(EpisodeClosedError, match="step 4 was not recorded"):
            journal.append_step(episode.id, forward(4))
        assert len(episode_steps(journal.engine, episode.id)) == 3


@pytest.mark.parametrize("blocked", ["", "obstacle 0.14 m ahead of the front"])
def test_a_movement_comes_back_with_what_was_driven_of_it(url: str, blocked: str) -> None:
    result = MotionResult(
        not blocked, 0.4, 0.1, 2.0, pose=Pose(0.4, 0.0, 0.1), path_m=0.45, blocked=blocked, waiting_s=0.5
    )
    movement = Trajectory(((0.5, 0.0), (1.0, 0.25)))
    step = replace(forward(1), action=Action.TRAJECTORY, raw_action="", result=result, movement=movement, part=(1, 4))
    step = replace(step, answer=AnswerTiming(1.5, 0.3, 2.0, stale=True))
    why = "the pixel has no depth"
    refused = replace(forward(2), action=Action.PIXEL, result=None, movement=Pixel(12.0, 40.0), refusal=why)
    with Journal.open(url) as journal:
        episode = begun(journal, journal.find_or_create_campaign(plan()).trials[0])
        journal.append_step(episode.id, step)
        journal.append_step(episode.id, refused)
        journal.append_step(episode.id, forward(3))
        driven, not_begun, discrete = episode_steps(journal.engine, episode.id)
    assert (driven.movement, driven.part, driven.result) == (movement, (1, 4), result)
    assert (driven.answer, discrete.answer) == (step.answer, None)
    assert (driven.blocked, driven.refusal, driven.raw_action) == (bool(blocked), blocked, "TRAJECTORY")
    assert (not_begun.refusal, discrete.refusal) == (why, "")
    assert (not_begun.movement, not_begun.result, not_begun.blocked) == (Pixel(12.0, 40.0), None, True)
    assert (discrete.movement, discrete.part, discrete.blocked) == (None, None, False)
