"""The Rerun file is derived data: whatever happened to it, the record brings it back."""

import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import rerun as rr
from rerun.chunk import RrdReader

from tests.viewer.synthetic_episode import UUID, entries, header, record
from vsnbench.database.journal import Journal
from vsnbench.errors import RecordError, UsageError
from vsnbench.protocol.fix import PoseSource
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.record.entries import EndEntry, StepEntry
from vsnbench.record.images import rgb_path
from vsnbench.record.results import ResultsDirectory
from vsnbench.viewer.rebuild import current_recording, recording_fault
from vsnbench.viewer.recording import EpisodeRecording
from vsnbench.viewer.replay import read_episode


@pytest.fixture(autouse=True)
def _wrong_arguments_raise() -> Iterator[None]:
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


@pytest.fixture
def results(tmp_path: Path) -> ResultsDirectory:
    return ResultsDirectory.locate(tmp_path / "results", environment={})


def rows(path: Path) -> Counter[str]:
    found: Counter[str] = Counter()
    for chunk in RrdReader(path).stream().to_chunks():
        found[chunk.entity_path] += chunk.num_rows
    return found


def content(path: Path) -> dict[tuple[str, str], list[object]]:
    """Return by entity and component every value with its step and its robot time, in any order."""
    found: dict[tuple[str, str], list[object]] = defaultdict(list)
    for chunk in RrdReader(path).stream().to_chunks():
        columns = chunk.to_record_batch().to_pydict()
        times = [columns.get(timeline, [None] * chunk.num_rows) for timeline in ("step", "robot_time")]
        for name, values in columns.items():
            if name not in ("step", "robot_time", "log_time", "log_tick") and not name.endswith("RowId"):
                found[chunk.entity_path, name] += zip(*times, values, strict=True)
    return {key: sorted(rows, key=str) for key, rows in found.items()}  # how rows are packed into chunks is a clock's


def test_a_copy_made_afterwards_is_the_one_that_is_made_while_the_robot_drives(
    results: ResultsDirectory, tmp_path: Path
) -> None:
    number = record(results, 5)
    with EpisodeRecording(read_episode(results, number).header, tmp_path / "live.rrd") as live:
        for entry in entries(5):
            live.add(entry)
    was, now = content(tmp_path / "live.rrd"), content(current_recording(results, number))
    assert {"/camera/rgb", "/camera/depth", "/plan/policy/map", "/decision/text", "/verdict"} <= {key[0] for key in was}
    assert now.keys() == was.keys()
    assert [key for key in was if now[key] != was[key]] == [("/__properties", "RecordingInfo:start_time")]


def test_a_good_file_is_left_alone(results: ResultsDirectory) -> None:
    number = record(results, 3)
    path = current_recording(results, number)
    was = path.stat()
    assert current_recording(results, number) == path
    now = path.stat()
    assert (now.st_ino, now.st_mtime_ns, now.st_size) == (was.st_ino, was.st_mtime_ns, was.st_size)


@pytest.mark.parametrize(
    ("damage", "fault"),
    [
        (lambda content: content[: len(content) // 2], "broken"),
        (lambda content: content[:-40], "broken"),
        (lambda content: b"", "not a Rerun recording"),
        (lambda content: b"not a recording at all", "not a Rerun recording"),
        (lambda content: content[:5] + bytes([content[5] + 1]) + content[6:], "written by Rerun 0.42"),
    ],
    ids=["half of it", "no footer, as after kill -9", "empty", "foreign", "a newer SDK"],
)
def test_a_file_that_cannot_be_shown_is_built_anew(results: ResultsDirectory, damage, fault: str) -> None:  # type: ignore[no-untyped-def]
    number = record(results, 3)
    path = current_recording(results, number)
    whole = rows(path)
    path.write_bytes(damage(path.read_bytes()))
    assert fault in recording_fault(path, UUID, read_episode(results, number).end)
    assert rows(current_recording(results, number)) == whole


def test_what_a_killed_run_left_of_its_file_is_cleared_away(results: ResultsDirectory) -> None:
    number = record(results, 3)
    killed = subprocess.Popen([sys.executable, "-c", ""])
    killed.wait()
    part = results.path / "episodes" / f"{number:06d}" / f".episode.rrd.{killed.pid}.part"
    part.write_bytes(b"RRF2")
    current_recording(results, number)
    assert [file.name for file in part.parent.glob("*rrd*")] == ["episode.rrd"]


def test_a_later_verdict_is_shown(results: ResultsDirectory) -> None:
    number = record(results, 3)
    current_recording(results, number)
    taped = Verdict(EndReason.STOP, False, "taped: 1.04 m", GoalDistance(1.04, PoseSource.TAPE, "chair-2"))
    with Journal.open(results.database_url) as journal:
        journal.judge(number, taped, author="operator")
    path = current_recording(results, number)
    texts = [
        str(chunk.to_record_batch().column("TextDocument:text").to_pylist())
        for chunk in RrdReader(path).stream().to_chunks()
        if chunk.entity_path == "/verdict" and chunk.is_static
    ]
    assert len(texts) == 1
    assert "taped: 1.04 m" in texts[0]


def test_an_episode_that_still_runs_is_shown_as_far_as_it_is(results: ResultsDirectory) -> None:
    number = record(results, 4, ended=False)
    assert rows(current_recording(results, number))["/status"] == 4


def test_a_lost_image_costs_only_itself(results: ResultsDirectory) -> None:
    number = record(results, 4)
    rgb_path(results.episode_directory(f"episodes/{number:06d}"), 2).unlink()
    found = rows(current_recording(results, number))
    assert (found["/camera/rgb"], found["/status"]) == (3, 4)


def test_an_unknown_episode_is_a_mistake_of_the_command(results: ResultsDirectory) -> None:
    record(results, 2)
    with pytest.raises(UsageError, match="no episode 99"):
        current_recording(results, 99)


def test_a_directory_without_a_record_says_so(results: ResultsDirectory) -> None:
    with pytest.raises(RecordError, match="no record"):
        current_recording(results, 1)


def test_the_record_gives_back_the_frames_that_went_in(results: ResultsDirectory) -> None:
    replay = read_episode(results, record(results, 4))
    given = list(entries(4))
    assert replay.header == replace(header(), episode_id=replay.header.episode_id, robot=replay.header.robot)
    assert [type(entry) for entry in replay.entries] == [type(entry) for entry in given]
    assert replay.end == next(entry for entry in given if isinstance(entry, EndEntry))
    for was, now in zip(given, replay.entries, strict=True):
        if isinstance(was, StepEntry) and isinstance(now, StepEntry):
            assert (now.rgb_jpeg, now.depth_png) == (was.rgb_jpeg, was.depth_png)
            assert replace(now.step, recorded_at=None) == was.step
