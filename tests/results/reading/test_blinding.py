"""What a query returns of an episode of a blinded study."""

from pathlib import Path

from tests.results.studies_of_a_lab import apply_merge, lock
from vsnbench import open_results
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.reading.blinding import HIDDEN_COLUMNS, hide_steps
from vsnbench.results.reading.queries import EpisodeFilter, episode_record, episode_steps, list_episodes
from vsnbench.results.writing.journal import Journal


def test_the_times_of_a_blinded_arm_are_hidden_because_they_separate_the_models(tmp_path: Path) -> None:
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        study = lock(journal)
        apply_merge(journal, study, range(1))
        details, steps = episode_record(journal.engine, 1), episode_steps(journal.engine, 1)
        assert (details.ended_at, details.wall_duration_s) == (None, None)
        assert [summary.ended_at for summary in list_episodes(journal.engine, EpisodeFilter())] == [None]
        assert len(steps) == 1
        for step in steps:
            assert (step.recorded_at, step.stamp_s) == (None, 0.0)
            assert (step.timings.sense_s, step.timings.infer_s, step.timings.move_s) == (None, None, None)
            assert step.result is not None
            assert step.result.duration_s == 1.5, "of the movement alone"
        assert [step.stamp_s for step in hide_steps(steps * 3)] == [0.0, 1.5, 3.0], "exports have times in order"
        results = open_results(tmp_path)
        hidden = results.steps()[[*HIDDEN_COLUMNS & set(results.steps().columns)]]
        assert (len(hidden), hidden.notna().sum().sum()) == (1, 0)
        assert results.episodes()[["ended_at", "wall_duration_s", "thinking_s"]].notna().sum().sum() == 0
        journal.unblind_study(study.id, reason="over")
        assert results.episodes()["ended_at"].notna().all()
        assert results.steps()["recorded_at"].notna().all()
        assert episode_record(journal.engine, 1).ended_at is not None
        assert all(summary.ended_at is not None for summary in list_episodes(journal.engine, EpisodeFilter()))
        assert all(step.recorded_at is not None for step in episode_steps(journal.engine, 1))
