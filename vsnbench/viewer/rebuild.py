"""Brings an episode's Rerun file to what the record says: kept when it is whole and current, else built anew."""

import logging
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from vsnbench.errors import RecordError
from vsnbench.record.entries import EndEntry
from vsnbench.record.results import ResultsDirectory
from vsnbench.viewer.recording import APPLICATION, FILE_NAME, EpisodeRecording
from vsnbench.viewer.replay import EpisodeReplay, read_episode
from vsnbench.viewer.viewers import require_rerun

if TYPE_CHECKING:
    from rerun.chunk import Chunk

logger = logging.getLogger(__name__)

VERDICT_ENTITY = "/verdict"
_MAGIC = b"RRF2"


def current_recording(results: ResultsDirectory, episode_id: int) -> Path:
    """Return an episode's Rerun file, built from the record when it is missing, broken, foreign or out of date.

    Raises:
        UsageError: there is no such episode, or Rerun is not installed.
        RecordError: the record cannot be read or the file cannot be written.
    """
    require_rerun()
    replay = read_episode(results, episode_id)
    if replay.keeps_no_images:
        logger.warning(
            "episode %d keeps no images: it shows where the robot went, what it did and why, and not what it saw",
            episode_id,
        )
    path = replay.directory / FILE_NAME
    fault = recording_fault(path, replay.header.uuid, replay.end)
    if fault:
        logger.info("building %s: %s", path, fault)
        rebuild(replay, path)
    return path


def rebuild(replay: EpisodeReplay, path: Path) -> None:
    """Write an episode's Rerun file from its record; one that still runs is written as far as it is.

    Raises:
        RecordError: it cannot be written.
    """
    with EpisodeRecording(replay.header, path, rebuilding=True) as recording:
        for entry in replay.entries:
            recording.add(entry)
    summary = recording.close()
    if summary.path is None:
        raise RecordError(f"cannot build {path}: {summary.error}")


def recording_fault(path: Path, uuid: str, end: EndEntry | None) -> str:
    """Return, in words, why a Rerun file cannot be shown for an episode; empty when it can.

    Args:
        path: the file.
        uuid: the episode that it should hold.
        end: the standing verdict that it should show; None for an episode that still runs.
    """
    import rerun as rr
    from rerun.chunk import RrdReader
    from rerun.error_utils import RerunWarning

    if not path.is_file():
        return "there is no such file"
    if end is None:
        return "the episode goes on"
    with path.open("rb") as file:
        head = file.read(8)
    if len(head) < 8 or head[:4] != _MAGIC:
        return "it is not a Rerun recording"
    if tuple(head[4:6]) != tuple(int(part) for part in rr.__version__.split(".")[:2]):
        return f"it was written by Rerun {head[4]}.{head[5]}, and this is {rr.__version__}"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RerunWarning)  # it warns of a missing footer
            reader = RrdReader(path)
        recordings = reader.recordings()
        known = {(entry.application_id, entry.recording_id) for entry in recordings}
        verdicts = [_document(chunk) for chunk in reader.stream().to_chunks() if chunk.entity_path == VERDICT_ENTITY]
    except (RuntimeError, ValueError, OSError, RerunWarning) as error:
        return f"it is broken: {error}"
    if (APPLICATION, uuid) not in known:
        return "it holds another episode"
    if not any(end.verdict.text in text for text in verdicts):
        return "it does not show the verdict that stands"
    return ""


def _document(chunk: "Chunk") -> str:
    batch = chunk.to_record_batch()
    return str(batch.column("TextDocument:text").to_pylist()) if "TextDocument:text" in batch.schema.names else ""
