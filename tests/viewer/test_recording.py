"""Rerun recordings of episodes: content, and no delay of the robot."""

import logging
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest
import rerun as rr
from rerun.chunk import Chunk, RrdReader

from tests.viewer.synthetic_episode import UUID, entries, header, write
from vsnbench.results.files.episode_entries import StepEntry
from vsnbench.values.decision import Diagnostics
from vsnbench.viewer import recording as recording_module
from vsnbench.viewer.recording import EpisodeRecording
from vsnbench.viewer.web_viewer import WebViewer

PER_STEP = (
    "/camera/rgb",
    "/camera/rgb/detections",
    "/camera/depth",
    "/plan/robot/shell",
    "/plan/robot/heading",
    "/plan/policy/map",
    "/plan/policy/nodes",
    "/plan/policy/path",
    "/plan/policy/sub_goal",
    "/actions/action",
    "/actions/outcome",
    "/distance/to_goal",
    "/decision/text",
    "/decision/scores/p\\(STOP\\)",
    "/status",
)
STATIC = ("/plan/site", "/plan/goal/instances", "/plan/goal/success_zone", "/plan/start", "/verdict")


@pytest.fixture(autouse=True)
def _wrong_arguments_raise() -> Iterator[None]:
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


def chunks(path: Path) -> list[Chunk]:
    return RrdReader(path).stream().to_chunks()


def steps_of(path: Path, entity: str) -> list[int]:
    found: list[int] = []
    for chunk in chunks(path):
        if chunk.entity_path == entity and not chunk.is_static:
            found += chunk.to_record_batch().column("step").to_pylist()
    return sorted(found)


def column(path: Path, entity: str, component: str) -> list[object]:
    rows: list[object] = []
    for chunk in chunks(path):
        if chunk.entity_path == entity:
            batch = chunk.to_record_batch()
            rows += [row for name in batch.schema.names if name == component for row in batch.column(name).to_pylist()]
    return rows


def test_every_entity_has_every_step(tmp_path: Path) -> None:
    path = tmp_path / "episode.rrd"
    assert write(path, count=6) == ""
    missing = {entity: set(range(1, 7)) - set(steps_of(path, entity)) for entity in PER_STEP}
    assert not any(missing.values()), missing
    assert steps_of(path, "/plan/end") == [7], "after the last action"
    assert set(STATIC) <= {chunk.entity_path for chunk in chunks(path) if chunk.is_static}
    assert not list(tmp_path.glob("*.part"))


def test_the_recording_contains_its_layout_and_name(tmp_path: Path) -> None:
    write(tmp_path / "episode.rrd", count=2)
    reader = RrdReader(tmp_path / "episode.rrd")
    (recording,) = reader.recordings()
    assert (recording.application_id, recording.recording_id) == ("vsnbench", UUID)
    assert reader.blueprints()


def test_the_trajectory_is_in_the_frame_of_the_site(tmp_path: Path) -> None:
    write(tmp_path / "episode.rrd", count=4)
    first = column(tmp_path / "episode.rrd", "/plan/trajectory", "LineStrips2D:strips")[0]
    begin = header().begin.pose
    after = next(entry for entry in entries(4) if isinstance(entry, StepEntry)).step.world
    assert after is not None
    np.testing.assert_allclose(first, [[begin.position, after.pose.position]], atol=1e-5)


def test_an_image_has_the_recorded_bytes(tmp_path: Path) -> None:
    write(tmp_path / "episode.rrd", count=3)
    stored = column(tmp_path / "episode.rrd", "/camera/rgb", "EncodedImage:blob")
    given = [entry.rgb_jpeg for entry in entries(3) if isinstance(entry, StepEntry)]
    assert [np.asarray(blob, np.uint8).tobytes() for [blob] in stored] == given  # type: ignore[misc]


def test_a_policy_without_diagnostics_is_recorded(tmp_path: Path) -> None:
    assert write(tmp_path / "episode.rrd", count=3, diagnostics=False) == ""
    assert not any(chunk.entity_path.startswith("/decision/scores") for chunk in chunks(tmp_path / "episode.rrd"))


def test_a_full_queue_drops_steps_and_does_not_delay_the_robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = threading.Event()
    really_open = recording_module.open_recording

    def held_up(*arguments: object) -> rr.RecordingStream:
        assert go_on.wait(30)
        return really_open(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(recording_module, "open_recording", held_up)
    monkeypatch.setattr(recording_module, "QUEUE_ENTRIES", 4)
    recording = EpisodeRecording(header(), tmp_path / "episode.rrd")
    step = next(entries(2))
    longest_s = 0.0
    for _ in range(10):
        began = time.perf_counter()
        recording.add(step)
        longest_s = max(longest_s, time.perf_counter() - began)
    go_on.set()
    assert recording.close() == "6 entries are missing in the Rerun recording"
    assert longest_s < 0.1
    assert list(tmp_path.iterdir()) == []


def test_a_thread_that_hangs_is_abandoned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = threading.Event()

    def stuck(*_: object) -> rr.RecordingStream:
        assert go_on.wait(60)
        raise OSError("the disk came back too late")

    monkeypatch.setattr(recording_module, "open_recording", stuck)
    monkeypatch.setattr(recording_module, "QUEUE_ENTRIES", 2)
    monkeypatch.setattr(recording_module, "CLOSE_TIMEOUT_S", 0.2)
    recording = EpisodeRecording(header(), tmp_path / "episode.rrd")
    for entry in entries(5):
        recording.add(entry)
    closing = threading.Thread(target=recording.close, daemon=True)
    closing.start()
    closing.join(30)
    try:
        assert not closing.is_alive(), "the queue is full and no thread empties it"
        assert "not finished after 0.2 s" in recording.close()
    finally:
        go_on.set()
    deadline = time.monotonic() + 30
    while any(thread.name == "rerun-17" for thread in threading.enumerate()):
        assert time.monotonic() < deadline, "the abandoned thread ends as soon as possible"


def test_consecutive_episodes_leave_no_threads_or_files_open(tmp_path: Path) -> None:
    process = psutil.Process()
    assert write(tmp_path / "episode.rrd", count=3) == ""
    threads, files = process.num_threads(), process.num_fds()
    for _ in range(6):
        assert write(tmp_path / "episode.rrd", count=3) == ""
    deadline = time.monotonic() + 30
    while (process.num_threads(), process.num_fds()) > (threads, files):  # a thread may be ending
        assert time.monotonic() < deadline, (process.num_threads(), process.num_fds(), threads, files)


def test_an_error_of_rerun_is_logged_once_and_ends_the_recording(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "file" / "episode.rrd"
    path.parent.write_text("a file where the episode's directory should be")
    with caplog.at_level(logging.WARNING), EpisodeRecording(header(), path) as recording:
        for entry in entries(5):
            recording.add(entry)
    assert "FileExistsError" in recording.close()
    assert len([record for record in caplog.records if "Rerun recording stopped" in record.message]) == 1


def test_an_unfinished_episode_gets_no_final_file(tmp_path: Path) -> None:
    with EpisodeRecording(header(), tmp_path / "episode.rrd") as recording:
        recording.add(next(entries(3)))
    assert recording.close() == "the episode has not ended"
    assert list(tmp_path.iterdir()) == []


def test_adding_after_the_end_is_ignored(tmp_path: Path) -> None:
    recording = EpisodeRecording(header(), tmp_path / "episode.rrd", rebuilding=True)
    for entry in entries(2):
        recording.add(entry)
    assert recording.close() == ""
    recording.add(next(entries(2)))
    assert steps_of(tmp_path / "episode.rrd", "/status") == [1, 2]


def test_old_detections_are_removed_from_the_image(tmp_path: Path) -> None:
    first, second = [entry for entry in entries(4) if isinstance(entry, StepEntry)][:2]
    bare = replace(second, decision=replace(second.decision, diagnostics=Diagnostics()))
    with EpisodeRecording(header(), tmp_path / "episode.rrd", rebuilding=True) as recording:
        recording.add(first)
        recording.add(bare)
        recording.add(replace(bare, step=replace(bare.step, number=3)))
    boxes = column(tmp_path / "episode.rrd", "/camera/rgb/detections", "Boxes2D:half_sizes")
    assert [len(row) for row in boxes] == [2, 0]  # type: ignore[arg-type]
    goals = column(tmp_path / "episode.rrd", "/plan/policy/sub_goal", "Points2D:positions")
    assert [len(row) for row in goals] == [1, 0]  # type: ignore[arg-type]


def test_closing_the_viewer_does_not_stop_the_recording(tmp_path: Path) -> None:
    viewer = WebViewer(port=0)
    with EpisodeRecording(header(), tmp_path / "episode.rrd", viewer.grpc_url) as recording:
        for number, entry in enumerate(entries(20)):
            if number == 5:
                viewer.close()
            recording.add(entry)
    assert recording.close() == "", "a recording that the viewer holds up is abandoned after CLOSE_TIMEOUT_S"
    assert steps_of(tmp_path / "episode.rrd", "/status") == list(range(1, 21))
