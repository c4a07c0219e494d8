"""One episode as one Rerun recording: written off the control path, through a bounded queue, by one thread.

The recording is a copy for looking at; the database and the image files are the record. So nothing that goes wrong
here may end an episode or hold up a robot: when the queue is full the caller waits `PATIENCE_S` at most and then this
step's copy is dropped, and an error of Rerun is logged once and ends the copy. A recording that is not whole never
gets its final name; `vsnbench view` then builds it from the record.
"""

import contextlib
import logging
import os
import queue
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from vsnbench.record.entries import EndEntry, Entry, EpisodeHeader, StepEntry
from vsnbench.viewer.viewers import is_listening, rerun_is_installed
from vsnbench.whole_files import part_path, sweep_parts

if TYPE_CHECKING:
    import rerun as rr

logger = logging.getLogger(__name__)

APPLICATION = "vsnbench"
FILE_NAME = "episode.rrd"
QUEUE_ENTRIES = 64
PATIENCE_S = 0.005
CLOSE_TIMEOUT_S = 20.0


@dataclass(frozen=True, slots=True)
class RecordingSummary:
    """What became of a recording."""

    path: Path | None
    """The finished file; None when it is not whole and has to be rebuilt."""
    steps: int
    dropped: int
    error: str = ""


class EpisodeRecording:
    """Writes `episode.rrd` while an episode runs, or from its record afterwards; a context manager.

    Args:
        header: what is known before the first step.
        path: the final file; it is hidden until it is whole.
        viewer_url: gRPC address of a viewer that shows the episode as it happens.
        rebuilding: no robot waits, so nothing is dropped however full the queue; and an episode that has not ended is
            kept as far as it is.
    """

    def __init__(
        self, header: EpisodeHeader, path: Path, viewer_url: str | None = None, *, rebuilding: bool = False
    ) -> None:
        self._header = header
        self._path = path
        self._rebuilding = rebuilding
        self._part = part_path(path)
        self._viewer_url = viewer_url
        self._patience_s = None if rebuilding else PATIENCE_S
        self._entries: queue.Queue[Entry | None] = queue.Queue(QUEUE_ENTRIES)
        self._steps = 0
        self._dropped = 0
        self._error = ""
        self._ended = False
        self._abandoned = False
        self._closed: RecordingSummary | None = None
        self._worker = threading.Thread(target=self._work, name=f"rerun-{header.episode_id}", daemon=True)
        self._worker.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add(self, entry: Entry) -> None:
        """Hand over a step, an event or the end; never raises, returns within `PATIENCE_S`."""
        if self._closed is not None or self._error:
            return
        try:
            self._entries.put(entry, timeout=self._patience_s)
        except queue.Full:
            self._dropped += 1

    def close(self) -> RecordingSummary:
        """Write what is queued and finish the file; it gets its name only when it is whole. May be called again.

        A worker that is stuck in Rerun or on a disk is left behind after `CLOSE_TIMEOUT_S`.
        """
        if self._closed is None:
            give_up_s = time.monotonic() + CLOSE_TIMEOUT_S
            with contextlib.suppress(queue.Full):
                self._entries.put(None, timeout=None if self._rebuilding else CLOSE_TIMEOUT_S)
            self._worker.join(None if self._rebuilding else max(give_up_s - time.monotonic(), 0))
            if self._worker.is_alive():
                self._abandoned = True
                self._error = f"the recording was not finished after {CLOSE_TIMEOUT_S:g} s"
                logger.warning("episode %d: %s", self._header.episode_id, self._error)
            whole = (self._ended or self._rebuilding) and not self._dropped and not self._error
            try:
                if whole:
                    self._part.replace(self._path)
                else:
                    self._part.unlink(missing_ok=True)
            except OSError as error:
                whole, self._error = False, self._error or str(error)
            if self._dropped:
                logger.info("episode %d: %d entries not in Rerun", self._header.episode_id, self._dropped)
            self._closed = RecordingSummary(self._path if whole else None, self._steps, self._dropped, self._error)
        return self._closed

    def _work(self) -> None:
        try:
            if rerun_is_installed():
                self._write()
                return
            self._error = "Rerun is not installed"
        except Exception as error:  # whatever Rerun or the disk does, the episode goes on
            self._error = f"{type(error).__name__}: {error}"
            logger.warning("episode %d: its Rerun recording stopped: %s", self._header.episode_id, self._error)
        while not self._abandoned and self._entries.get() is not None:
            pass

    def _write(self) -> None:
        import rerun_bindings

        try:
            self._log()
        finally:
            # A stream that nobody refers to any more keeps its threads and buffers until it is cleaned up by name.
            rerun_bindings.flush_and_cleanup_orphaned_recordings()

    def _log(self) -> None:
        from vsnbench.viewer.drawing import EpisodeDrawing
        from vsnbench.viewer.entity_log import AsItHappens, InColumns

        self._part.parent.mkdir(parents=True, exist_ok=True)
        sweep_parts(self._path.parent, self._path.name)
        self._part.unlink(missing_ok=True)  # whatever waits there, a link included, is not written through
        recording = open_recording(self._header, self._part)
        live = _open_live(self._header, self._viewer_url)
        try:
            drawings = [EpisodeDrawing(InColumns(recording), self._header)]
            if live is not None:
                drawings.append(EpisodeDrawing(AsItHappens(live), self._header))
            while not self._abandoned and (entry := self._entries.get()) is not None:
                for drawing in drawings:
                    drawing.draw(entry)
                self._steps += isinstance(entry, StepEntry)
                self._ended |= isinstance(entry, EndEntry)
            for drawing in drawings:
                drawing.finish()
        finally:
            if live is not None:
                # A viewer that was closed keeps its stream waiting for seconds: nobody else has to.
                threading.Thread(target=live.disconnect, name="rerun-live-end", daemon=True).start()
            recording.flush(timeout_sec=CLOSE_TIMEOUT_S / 2)
            recording.disconnect()


def open_recording(header: EpisodeHeader, path: Path) -> "rr.RecordingStream":
    """Return a stream into a file."""
    # Rerun's own words on stderr would break into the console; what went wrong is logged in ours.
    os.environ.setdefault("RUST_LOG", "off")
    import rerun as rr

    recording = rr.RecordingStream(APPLICATION, recording_id=header.uuid)
    recording.save(path)
    return recording


def _open_live(header: EpisodeHeader, viewer_url: str | None) -> "rr.RecordingStream | None":
    """Return a stream of its own into a viewer, so that the file does not depend on it; None when it is not there."""
    import rerun as rr

    if viewer_url is None or not is_listening(viewer_url):
        return None
    live = rr.RecordingStream(APPLICATION, recording_id=header.uuid)
    live.connect_grpc(viewer_url)
    return live
