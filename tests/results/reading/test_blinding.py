"""What a query returns of an episode of a blinded study."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from tests.results.records_of_a_lab import begun, forward, plan, stopped
from tests.results.studies_of_a_lab import apply_merge, lock
from vsnbench import open_results
from vsnbench.protocol.execution import Execution
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.analysis.courses import measures_of
from vsnbench.report.analysis.reading import read_courses
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.reading.blinding import HIDDEN_COLUMNS, hide_steps
from vsnbench.results.reading.queries import EpisodeFilter, episode_record, episode_steps, list_episodes
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.study.blinding import BlindViewer
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.pose import Pose
from vsnbench.values.step import AnswerTiming


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


def test_durations_and_waiting_of_a_blinded_robot_that_drives_on_are_hidden_too(tmp_path: Path) -> None:
    parameters = ProtocolParameters().executed(Execution())
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        study = lock(journal, of=replace(plan(), protocol=parameters))
        claim = begun(journal, journal.study_progress(study.id)[0].trial)
        for number in (1, 2):
            motion = MotionResult(True, 0.25, 0.0, 1.7, pose=Pose(number * 0.25, 0.0), path_m=0.25, waiting_s=0.9)
            answer = AnswerTiming(number + 0.6, 0.6, number + 1.7)
            journal.append_step(claim.id, replace(forward(number), result=motion, answer=answer))
        journal.end_episode(claim.id, stopped(success=True))
        results = open_results(tmp_path)

        def times() -> list[Any]:
            steps, frame = episode_steps(journal.engine, claim.id), results.steps()
            episode = episode_record(journal.engine, claim.id)
            return [
                episode.duration_s,
                list_episodes(journal.engine, EpisodeFilter())[0].duration_s,
                measures_of(journal.engine, episode).waiting_s,
                read_courses(journal.engine, [claim.id])[claim.id].waiting_s,
                *results.episodes()[["duration_s", "sct"]].iloc[0],
                *frame["duration_s"],
                *(value for step in steps for value in (step.answer, step.result and step.result.duration_s)),
                *("answer" in movement or None for movement in frame["movement"]),
                *(movement.get("waiting_s") for movement in frame["movement"]),
            ]

        assert [value for value in times() if value is not None and not math.isnan(value)] == []
        assert [step.stamp_s for step in episode_steps(journal.engine, claim.id)] == [0.0, 1.0]
        assert results.steps()["movement"].tolist() == [{"path_m": 0.25}, {"path_m": 0.25}]
        journal.unblind_study(study.id, reason="over")
        assert None not in times()


def test_rerun_shows_no_duration_of_a_blinded_robot_that_drives_on() -> None:
    shown: list[Any] = []
    inner: Any = SimpleNamespace(open_episode=lambda *_: SimpleNamespace(add=shown.append))
    for execution in (None, Execution()):
        header: Any = SimpleNamespace(parameters=ProtocolParameters().executed(execution))
        sink = BlindViewer(inner).open_episode(header, Path())
        sink.add(stopped(success=True))
    assert [entry.duration_s for entry in shown if isinstance(entry, EpisodeEnd)] == [4.5, None]
