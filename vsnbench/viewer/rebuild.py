"""Rebuilds an episode's Rerun file if it is missing, damaged or outdated."""

import logging
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from vsnbench.errors import RecordError
from vsnbench.files.disk_cache import cache_directory, can_write, key_of
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.viewer.recording import APPLICATION, FILE_NAME, EpisodeRecording
from vsnbench.viewer.replay import EpisodeReplay, read_episode
from vsnbench.viewer.viewers import require_rerun

if TYPE_CHECKING:
    from rerun.chunk import Chunk

logger = logging.getLogger(__name__)

VERDICT_ENTITY = "/verdict"
_MAGIC = b"RRF2"
_MAX_CACHED = 20
"""Number of Rerun files in the cache, for episodes of read-only results."""


def current_recording(results: ResultsDirectory, episode_id: int) -> Path:
    """Return an episode's Rerun file, and build it if necessary.

    Raises:
        UsageError: there is no such episode, or Rerun is not installed.
        RecordError: the results cannot be read, or the file cannot be written.
    """
    require_rerun()
    replay = read_episode(results, episode_id)
    if faults := replay.image_faults:
        logger.warning(
            "episode %d: images missing or damaged: %d (%s%s); `vsnbench db merge` with an intact copy repairs them",
            *(episode_id, len(faults), ", ".join(map(str, faults[:3])), ", ..." if len(faults) > 3 else ""),
        )
    elif replay.has_no_images:
        logger.warning(
            "episode %d has no recorded images; the plan, actions and decisions are shown",
            episode_id,
        )
    path = replay.directory / FILE_NAME
    fault = recording_fault(path, replay.header.uuid, replay.end)
    if fault and not can_write(replay.directory):
        path = cached_path(replay.header.uuid)
        fault = recording_fault(path, replay.header.uuid, replay.end)
    if fault:
        logger.info("building %s: %s", path, fault)
        rebuild(replay, path)
    return path


def cached_path(key: str) -> Path:
    """Return the path of a Rerun file in the cache, and remove the least recently used files.

    The file name is a hash of the key, so untrusted results cannot choose it.
    """
    folder = cache_directory() / "recordings"
    used = sorted(folder.glob("*.rrd"), key=lambda file: file.stat().st_mtime)
    for old in used[: -_MAX_CACHED + 1]:
        old.unlink(missing_ok=True)
    return folder / f"{key_of(key)}.rrd"


def rebuild(replay: EpisodeReplay, path: Path) -> None:
    """Write an episode's Rerun file; of a running episode, the part until now.

    Raises:
        RecordError: the file cannot be written.
    """
    with EpisodeRecording(replay.header, path, rebuilding=True) as recording:
        for entry in replay.entries:
            recording.add(entry)
    if fault := recording.close():
        raise RecordError(f"cannot build {path}: {fault}")


def recording_fault(path: Path, uuid: str, end: EpisodeEnd | None) -> str:
    """Return why a Rerun file cannot be shown for an episode, or an empty string.

    Args:
        path: the file.
        uuid: the episode that it must contain.
        end: the verdict that it must show; None for a running episode.
    """
    import rerun as rr
    from rerun.chunk import RrdReader
    from rerun.error_utils import RerunWarning

    if not path.is_file():
        return "the file does not exist"
    if end is None:
        return "the episode still runs"
    with path.open("rb") as file:
        head = file.read(8)
    if len(head) < 8 or head[:4] != _MAGIC:
        return "it is not a Rerun recording"
    if tuple(head[4:6]) != tuple(int(part) for part in rr.__version__.split(".")[:2]):
        return f"it was written by Rerun {head[4]}.{head[5]}; {rr.__version__} is installed"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RerunWarning)  # a missing footer is a warning
            reader = RrdReader(path)
        recordings = reader.recordings()
        known = {(entry.application_id, entry.recording_id) for entry in recordings}
        verdicts = [_document(chunk) for chunk in reader.stream().to_chunks() if chunk.entity_path == VERDICT_ENTITY]
    except (RuntimeError, ValueError, OSError, RerunWarning) as error:
        return f"it is damaged: {error}"
    if (APPLICATION, uuid) not in known:
        return "it contains another episode"
    if not any(end.verdict.text in text for text in verdicts):
        return "it does not show the current verdict"
    return ""


def _document(chunk: "Chunk") -> str:
    batch = chunk.to_record_batch()
    return str(batch.column("TextDocument:text").to_pylist()) if "TextDocument:text" in batch.schema.names else ""
