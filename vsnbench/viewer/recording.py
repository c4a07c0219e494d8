"""Writes the Rerun recording of an episode in a thread of its own.

The recording is a copy of the results for display, so its errors must not end an episode or delay a robot. If the
queue is full, the caller waits `ADD_TIMEOUT_S` and the step is dropped. An error of Rerun is logged and ends the
recording. An incomplete recording never gets its final name; `vsnbench view` rebuilds it.
"""

import contextlib
import logging
import os
import queue
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Self

from vsnbench.files.atomic import part_path, sweep_parts
from vsnbench.results.files.episode_entries import Entry, EpisodeHeader
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.viewer.viewers import is_listening, rerun_is_installed

if TYPE_CHECKING:
    import rerun as rr

logger = logging.getLogger(__name__)

APPLICATION = "vsnbench"
FILE_NAME = "episode.rrd"
QUEUE_ENTRIES = 64
ADD_TIMEOUT_S = 0.005
CLOSE_TIMEOUT_S = 20.0


class EpisodeRecording:
    """Writes `episode.rrd` during an episode, or rebuilds it; a context manager.

    Args:
        header: data that is known before the first step.
        path: the final file; it appears when it is complete.
        viewer_url: gRPC address of a live viewer.
        rebuilding: drop no steps, and accept an episode that has not ended.
    """

    def __init__(
        self, header: EpisodeHeader, path: Path, viewer_url: str | None = None, *, rebuilding: bool = False
    ) -> None:
        self._header = header
        self._path = path
        self._rebuilding = rebuilding
        self._part = part_path(path)
        self._viewer_url = viewer_url
        self._add_timeout_s = None if rebuilding else ADD_TIMEOUT_S
        self._entries: queue.Queue[Entry | None] = queue.Queue(QUEUE_ENTRIES)
        self._dropped = 0
        self._error = ""
        self._ended = False
        self._abandoned = False
        self._fault: str | None = None
        """What `close` returns; None before it."""
        self._worker = threading.Thread(target=self._work, name=f"rerun-{header.episode_id}", daemon=True)
        self._worker.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add(self, entry: Entry) -> None:
        """Add a step, an event or the end. Never raises, and returns within `ADD_TIMEOUT_S`."""
        if self._fault is not None or self._error:
            return
        try:
            self._entries.put(entry, timeout=self._add_timeout_s)
        except queue.Full:
            self._dropped += 1

    def close(self) -> str:
        """Write the queued entries and finish the file. Further calls return the same result.

        A thread that hangs in Rerun or on a disk is abandoned after `CLOSE_TIMEOUT_S`.

        Returns:
            Why there is no file, which must then be rebuilt; empty if the file is complete.
        """
        if self._fault is None:
            deadline_s = time.monotonic() + CLOSE_TIMEOUT_S
            with contextlib.suppress(queue.Full):
                self._entries.put(None, timeout=None if self._rebuilding else CLOSE_TIMEOUT_S)
            self._worker.join(None if self._rebuilding else max(deadline_s - time.monotonic(), 0))
            if self._worker.is_alive():
                self._abandoned = True
                self._error = f"the recording was not finished after {CLOSE_TIMEOUT_S:g} s"
                logger.warning("episode %d: %s", self._header.episode_id, self._error)
            missing = f"{self._dropped} entries are missing in the Rerun recording" if self._dropped else ""
            if missing:
                logger.info("episode %d: %s", self._header.episode_id, missing)
            ended = self._ended or self._rebuilding
            fault = self._error or missing or ("" if ended else "the episode has not ended")
            try:
                if fault:
                    self._part.unlink(missing_ok=True)
                else:
                    self._part.replace(self._path)
            except OSError as error:
                fault = fault or str(error)
            self._fault = fault
        return self._fault

    def _work(self) -> None:
        try:
            if rerun_is_installed():
                self._write()
                return
            self._error = "Rerun is not installed"
        except Exception as error:  # no error of Rerun or the disk may end the episode
            self._error = f"{type(error).__name__}: {error}"
            logger.warning("episode %d: the Rerun recording stopped: %s", self._header.episode_id, self._error)
        while not self._abandoned and self._entries.get() is not None:
            pass

    def _write(self) -> None:
        os.environ.setdefault("RUST_LOG", "off")  # keeps Rerun's own log messages off stderr
        from vsnbench.viewer.rerun_internals import free_unused_streams

        try:
            self._log()
        finally:
            free_unused_streams()

    def _log(self) -> None:
        from vsnbench.viewer.drawing import EpisodeDrawing
        from vsnbench.viewer.entity_log import ColumnLog, EntityLog

        self._part.parent.mkdir(parents=True, exist_ok=True)
        sweep_parts(self._path.parent, self._path.name)
        self._part.unlink(missing_ok=True)  # not written through, as it may be a link
        recording = open_recording(self._header, self._part)
        live = _open_live(self._header, self._viewer_url)
        try:
            drawings = [EpisodeDrawing(ColumnLog(recording), self._header)]
            if live is not None:
                drawings.append(EpisodeDrawing(EntityLog(live), self._header))
            while not self._abandoned and (entry := self._entries.get()) is not None:
                for drawing in drawings:
                    drawing.draw(entry)
                self._ended |= isinstance(entry, EpisodeEnd)
            for drawing in drawings:
                drawing.finish()
        finally:
            if live is not None:
                # Disconnecting from a viewer that was closed takes seconds.
                threading.Thread(target=live.disconnect, name="rerun-live-end", daemon=True).start()
            recording.flush(timeout_sec=CLOSE_TIMEOUT_S / 2)
            recording.disconnect()


def open_recording(header: EpisodeHeader, path: Path) -> "rr.RecordingStream":
    """Return a stream to a file."""
    import rerun as rr

    recording = rr.RecordingStream(APPLICATION, recording_id=header.uuid)
    recording.save(path)
    return recording


def _open_live(header: EpisodeHeader, viewer_url: str | None) -> "rr.RecordingStream | None":
    """Return a separate stream to a live viewer, or None if it does not listen."""
    import rerun as rr

    if viewer_url is None or not is_listening(viewer_url):
        return None
    live = rr.RecordingStream(APPLICATION, recording_id=header.uuid)
    live.connect_grpc(viewer_url)
    return live
