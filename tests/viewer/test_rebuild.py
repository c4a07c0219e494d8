"""Rebuilding of Rerun files from the results."""

import sqlite3
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
import rerun as rr
from rerun.chunk import RrdReader
from sqlalchemy import update

from tests.viewer.synthetic_episode import UUID, entries, header, record
from tests.web.results_browser.filmed_record import CAPTURES_S, FILM_S, make_filmed_record, pose_at
from vsnbench.errors import RecordError, UsageError
from vsnbench.interop.habitat import HabitatEpisode
from vsnbench.interop.importing import import_habitat, unsurveyed_site
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.files.episode_entries import StepEntry
from vsnbench.results.files.images import depth_path, rgb_path
from vsnbench.results.schema.tables import StepRow
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.results.writing.journal import Journal
from vsnbench.values.fix import PoseSource
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
    """Return all values with their steps and robot times, by entity and component."""
    found: dict[tuple[str, str], list[object]] = defaultdict(list)
    for chunk in RrdReader(path).stream().to_chunks():
        columns = chunk.to_record_batch().to_pydict()
        times = [columns.get(timeline, [None] * chunk.num_rows) for timeline in ("step", "robot_time")]
        for name, values in columns.items():
            if name not in ("step", "robot_time", "log_time", "log_tick") and not name.endswith("RowId"):
                found[chunk.entity_path, name] += zip(*times, values, strict=True)
    return {key: sorted(rows, key=str) for key, rows in found.items()}  # the order of chunks depends on timing


def test_images_of_a_film_are_on_the_robots_clock_with_the_robots_pose(tmp_path: Path) -> None:
    make_filmed_record(tmp_path)
    found = content(current_recording(ResultsDirectory.locate(tmp_path, environment={}), 1))
    times_s = sorted({*CAPTURES_S, *(time_s for times in FILM_S for time_s in times)})
    origins = {
        round(time.total_seconds(), 3): origin[0]
        for _, time, (origin, *_) in found["/plan/robot/heading", "Arrows2D:origins"]
        if time is not None
    }
    assert sorted({round(time.total_seconds(), 3) for _, time, _ in found["/camera/rgb", "EncodedImage:blob"]}) == [
        round(time_s - times_s[0], 3) for time_s in times_s
    ]
    assert [origins[round(time_s - times_s[0], 3)] for time_s in times_s] == pytest.approx(
        [pose_at(time_s).x_m for time_s in times_s], abs=1e-6
    )


def test_a_rebuilt_file_equals_the_live_recording(results: ResultsDirectory, tmp_path: Path) -> None:
    number = record(results, 5)
    with EpisodeRecording(read_episode(results, number).header, tmp_path / "live.rrd") as live:
        for entry in entries(5):
            live.add(entry)
    live_content, rebuilt = content(tmp_path / "live.rrd"), content(current_recording(results, number))
    assert {"/camera/rgb", "/camera/depth", "/plan/policy/map", "/decision/text", "/verdict"} <= {
        key[0] for key in live_content
    }
    assert rebuilt.keys() == live_content.keys()
    assert [key for key in live_content if rebuilt[key] != live_content[key]] == [
        ("/__properties", "RecordingInfo:start_time")
    ]


def test_a_current_file_is_not_rewritten(results: ResultsDirectory) -> None:
    number = record(results, 3)
    path = current_recording(results, number)
    was = path.stat()
    assert current_recording(results, number) == path
    now = path.stat()
    assert (now.st_ino, now.st_mtime_ns, now.st_size) == (was.st_ino, was.st_mtime_ns, was.st_size)


@pytest.mark.parametrize(
    ("damage", "fault"),
    [
        (lambda content: content[: len(content) // 2], "damaged"),
        (lambda content: content[:-40], "damaged"),
        (lambda content: b"", "not a Rerun recording"),
        (lambda content: b"not a recording at all", "not a Rerun recording"),
        (lambda content: content[:5] + bytes([content[5] + 1]) + content[6:], "written by Rerun 0.42"),
    ],
    ids=["truncated", "no-footer", "empty", "other-format", "newer-rerun"],
)
def test_an_unusable_file_is_rebuilt(results: ResultsDirectory, damage, fault: str) -> None:  # type: ignore[no-untyped-def]
    number = record(results, 3)
    path = current_recording(results, number)
    whole = rows(path)
    path.write_bytes(damage(path.read_bytes()))
    assert fault in recording_fault(path, UUID, read_episode(results, number).end)
    assert rows(current_recording(results, number)) == whole


def test_partial_files_of_a_killed_run_are_removed(results: ResultsDirectory) -> None:
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


def test_a_running_episode_is_shown_until_its_last_step(results: ResultsDirectory) -> None:
    number = record(results, 4, ended=False)
    assert rows(current_recording(results, number))["/status"] == 4


def test_a_missing_image_leaves_other_entities_complete(results: ResultsDirectory) -> None:
    number = record(results, 4)
    rgb_path(results.episode_directory(f"episodes/{number:06d}"), 2).unlink()
    found = rows(current_recording(results, number))
    assert (found["/camera/rgb"], found["/status"]) == (3, 4)


def test_an_unknown_episode_is_a_usage_error(results: ResultsDirectory) -> None:
    record(results, 2)
    with pytest.raises(UsageError, match="episode 99"):
        current_recording(results, 99)


def test_an_imported_episode_is_refused(results: ResultsDirectory) -> None:
    results.prepare()
    source = results.path / "results.json"
    source.write_text("[]")
    place = {"site": unsurveyed_site("hm3d"), "source": source, "protocol": ProtocolParameters()}
    with Journal.open(results.database_url) as journal:
        import_habitat(journal, [HabitatEpisode("chair", True, 20, 0.4)], model="m", **place)
    with pytest.raises(RecordError) as error:
        current_recording(results, 1)
    assert error.value.code == "imported-episode"


@pytest.mark.parametrize("content", ["[]", '{"max_actions": -1, "rooms": 3}', '"text"'])
@pytest.mark.parametrize("column", ["site.content", "robot.profile", "campaign.protocol"])
def test_an_unreadable_description_is_an_error(results: ResultsDirectory, column: str, content: str) -> None:
    record(results, 1)
    table, _, name = column.partition(".")
    with closing(sqlite3.connect(results.path / "vsnbench.db")) as database, database:
        database.execute(f"UPDATE {table} SET {name} = ?", [content])
    with pytest.raises(RecordError) as error:
        current_recording(results, 1)
    assert error.value.code == "damaged-record"


def test_a_directory_without_results_is_an_error(results: ResultsDirectory) -> None:
    with pytest.raises(RecordError):
        current_recording(results, 1)


def test_a_replay_has_the_recorded_entries(results: ResultsDirectory) -> None:
    replay = read_episode(results, record(results, 4))
    given = list(entries(4))
    assert replay.header == replace(header(), episode_id=replay.header.episode_id, robot=replay.header.robot)
    assert [type(entry) for entry in replay.entries] == [type(entry) for entry in given]
    assert replay.end == next(entry for entry in given if isinstance(entry, EpisodeEnd))
    for was, now in zip(given, replay.entries, strict=True):
        if isinstance(was, StepEntry) and isinstance(now, StepEntry):
            assert (now.rgb_jpeg, now.depth_png) == (was.rgb_jpeg, was.depth_png)
            assert replace(now.step, recorded_at=None) == was.step


def test_missing_and_damaged_images_are_named_in_a_warning(
    results: ResultsDirectory, caplog: pytest.LogCaptureFixture
) -> None:
    number = record(results, 3)
    with Journal.open(results.database_url) as journal, journal.engine.begin() as connection:
        connection.execute(update(StepRow).values(rgb_digest="blake3:0", depth_digest="blake3:1"))
    directory = read_episode(results, number).directory
    rgb_path(directory, 2).unlink()
    damaged = depth_path(directory, 3)
    damaged.write_bytes(damaged.read_bytes()[:-9])
    current_recording(results, number)
    (warning,) = [entry.getMessage() for entry in caplog.records if "damaged" in entry.getMessage()]
    assert "images missing or damaged: 2" in warning
    assert "rgb/0002.jpg is missing, depth/0003.png is incomplete" in warning
