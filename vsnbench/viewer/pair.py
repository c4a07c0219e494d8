"""Writes two episodes into one Rerun recording, side by side on one timeline."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from vsnbench.errors import RecordError
from vsnbench.files.atomic import atomic_file
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.viewer.rebuild import cached_path
from vsnbench.viewer.recording import APPLICATION
from vsnbench.viewer.replay import read_episode
from vsnbench.viewer.viewers import require_rerun

if TYPE_CHECKING:
    import rerun as rr

SIDES = ("left", "right")
"""Prefixes of the entities of the two episodes."""


class _PrefixedStream:
    """Logs to a stream with a prefix before every entity."""

    def __init__(self, stream: "rr.RecordingStream", prefix: str) -> None:
        self._stream = stream
        self._prefix = prefix

    def log(self, entity: str, *parts: Any, **options: Any) -> None:
        """Log an entity."""
        self._stream.log(f"{self._prefix}/{entity}", *parts, **options)

    def send_columns(self, entity: str, *parts: Any) -> None:
        """Send columns of an entity."""
        self._stream.send_columns(f"{self._prefix}/{entity}", *parts)

    def set_time(self, timeline: str, **value: Any) -> None:
        """Set the time of the following values."""
        self._stream.set_time(timeline, **value)


def pair_recording(results: ResultsDirectory, first: int, second: int) -> Path:
    """Return a Rerun file of two episodes in the cache; it is written anew each time, as verdicts may have changed.

    Raises:
        UsageError: there is no such episode, or Rerun is not installed.
        RecordError: the results cannot be read, or the file cannot be written.
    """
    require_rerun()
    os.environ.setdefault("RUST_LOG", "off")
    import rerun as rr

    from vsnbench.viewer.blueprint import pair_blueprint
    from vsnbench.viewer.drawing import EpisodeDrawing
    from vsnbench.viewer.entity_log import ColumnLog

    replays = [read_episode(results, number) for number in (first, second)]
    key = " ".join(replay.header.uuid for replay in replays)
    path = cached_path(key)
    with atomic_file(path) as part:
        stream = rr.RecordingStream(APPLICATION, recording_id=key)
        try:
            stream.save(part)
            stream.send_recording_name(f"episodes {first} and {second}")
            stream.send_blueprint(pair_blueprint([replay.header for replay in replays], SIDES))
            for side, replay in zip(SIDES, replays, strict=True):
                prefixed = cast("rr.RecordingStream", _PrefixedStream(stream, side))
                drawing = EpisodeDrawing(ColumnLog(prefixed), replay.header, with_layout=False)
                for entry in replay.entries:
                    drawing.draw(entry)
                drawing.finish()
            stream.flush(timeout_sec=10.0)
        except (RuntimeError, ValueError) as error:
            raise RecordError(f"cannot write {path}: {error}") from error
        finally:
            stream.disconnect()
    return path
