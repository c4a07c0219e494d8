"""Rerun's private API still has what `rerun_internals` uses."""

import gc
import threading
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from vsnbench.viewer.rerun_internals import convert_blueprint, free_unused_streams, send_blueprint
from vsnbench.viewer.static_entities import StaticEntities


def test_a_blueprint_is_converted_once_and_sent_to_recordings(tmp_path: Path) -> None:
    layout = StaticEntities()
    convert_blueprint(rrb.Blueprint(rrb.TextDocumentView(origin="verdict")), layout)
    for number in range(3):
        recording = rr.RecordingStream("test", recording_id=str(number))
        recording.save(tmp_path / f"{number}.rrd")
        send_blueprint(recording, layout)
        recording.disconnect()
        assert len(RrdReader(tmp_path / f"{number}.rrd").blueprints()) == 1


def test_unused_streams_leave_no_threads(tmp_path: Path) -> None:
    threads = threading.active_count()
    for number in range(5):
        rr.RecordingStream("test", recording_id=str(number)).save(tmp_path / f"{number}.rrd")
    gc.collect()
    free_unused_streams()
    assert threading.active_count() == threads
