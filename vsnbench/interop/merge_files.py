"""Selects intact image files for the episodes of a merge.

A copy is intact if every file of its step rows exists and has the bytes that were written; files of older records
without digests of their bytes must decode, and depth pixels match their digest.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from vsnbench.errors import RecordError
from vsnbench.files.atomic import write_atomic
from vsnbench.results.files.confined_paths import confined, read_confined
from vsnbench.results.files.image_set import ImageFault, image_faults
from vsnbench.results.files.staged_import import files_below
from vsnbench.results.merging.episodes import OtherRecord, step_digests
from vsnbench.results.merging.plan import MergePlan, OtherEpisode
from vsnbench.values.encoding.image_digest import StepDigests

Progress = Callable[[str, int, int], None]
"""Called with the kind of work, the amount done and the total."""

_NAMED = 3
"""Number of damaged files named in a message."""


@dataclass(frozen=True, slots=True)
class SourceRecord:
    """A record that is merged."""

    record: OtherRecord
    root_of: Callable[[str], Path | None]
    """Returns the results directory with the files of an episode directory, or None."""


@dataclass(frozen=True, slots=True)
class EpisodeFiles:
    """An intact copy of an episode's files."""

    root: Path
    """Results directory that contains it."""
    directory: str
    """Directory of the episode, relative to `root`."""
    sizes: Mapping[Path, int]
    """Files relative to the directory, with their sizes in bytes."""


@dataclass(frozen=True, slots=True)
class Repair:
    """Missing or damaged files of an episode in this record, with an intact copy."""

    number: int
    """Number of the episode in this record."""
    directory: str
    """Its directory, relative to the results directory; empty if the record has no images of it."""
    files: tuple[Path, ...]
    """Files to copy, relative to the directory."""
    source: EpisodeFiles


@dataclass(slots=True)
class FilePlan:
    """Files that a merge copies."""

    arriving: dict[str, EpisodeFiles] = field(default_factory=dict)
    """Files of each new episode, by UUID."""
    repairs: dict[str, Repair] = field(default_factory=dict)
    """Repairs of existing episodes, by UUID."""
    damaged_here: list[str] = field(default_factory=list)
    """One line per existing episode with damaged files and no intact copy elsewhere."""

    @property
    def file_count(self) -> int:
        """Number of files to copy."""
        return sum(len(source.sizes) for source in self.arriving.values()) + sum(
            len(repair.files) for repair in self.repairs.values()
        )

    @property
    def size_bytes(self) -> int:
        """Bytes to copy."""
        arriving = sum(sum(source.sizes.values()) for source in self.arriving.values())
        return arriving + sum(
            sum(size for file, size in repair.source.sizes.items() if file in repair.files)
            for repair in self.repairs.values()
        )


def plan_files(
    plan: MergePlan, sources: Sequence[SourceRecord], here: Path, *, without_images: bool, progress: Progress
) -> FilePlan:
    """Check the files of all new episodes and of those in several records.

    Raises:
        RecordError: images are missing or damaged, or a record contains a path outside its directory.
    """
    found = FilePlan()
    absent: list[OtherEpisode] = []
    damaged: list[tuple[OtherEpisode, list[ImageFault]]] = []
    total = len(plan.new_episodes) + len(plan.present)
    for done, new_episode in enumerate(plan.new_episodes, start=1):
        copies = [copy for copy in (new_episode, *plan.copies.get(new_episode.uuid, ())) if copy.images_directory]
        intact, faults = _intact_copy(copies, sources)
        if intact is not None:
            found.arriving[new_episode.uuid] = intact
        elif faults:
            damaged.append((copies[0], faults))
        elif copies:
            absent.append(copies[0])
        progress("checking images", done, total)
    if not without_images:
        _refuse(absent, damaged, sources)
    for done, (uuid, present) in enumerate(plan.present.items(), start=len(plan.new_episodes) + 1):
        copies = [copy for copy in plan.copies[uuid] if copy.images_directory]
        progress("checking images", done, total)
        if not copies:
            continue
        digests = _digests(copies[0], sources)
        faults = []
        if present.images_directory:
            faults = image_faults(confined(here, present.images_directory), digests, read=False)
            if not faults:
                continue
        intact, _ = _intact_copy(copies, sources)
        if intact is not None:
            files = tuple(fault.file for fault in faults) if present.images_directory else tuple(intact.sizes)
            found.repairs[uuid] = Repair(present.number, present.images_directory, files, intact)
        elif faults:
            found.damaged_here.append(f"episode {present.number}: {_in_words(faults)}")
    return found


def repair_file(results: Path, repair: Repair, file: Path) -> int:
    """Replace a damaged file by its intact copy, atomically, and return its size in bytes.

    Raises:
        RecordError: the copy can no longer be read, or the file cannot be written.
    """
    content = read_confined(repair.source.root / repair.source.directory, file)
    if content is None:
        raise RecordError(f"{repair.source.root / repair.source.directory / file} no longer exists")
    folder = confined(results, Path(repair.directory) / file.parent)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordError(f"cannot write {folder}: {error.strerror or error}") from error
    write_atomic(folder / file.name, content)
    return len(content)


def _intact_copy(
    copies: Sequence[OtherEpisode], sources: Sequence[SourceRecord]
) -> tuple[EpisodeFiles | None, list[ImageFault]]:
    """Return the first intact copy, or the faults of the first damaged one."""
    first_faults: list[ImageFault] = []
    for copy in copies:
        root = sources[copy.other].root_of(copy.images_directory)
        if root is None:
            continue
        files, top = files_below(root, copy.images_directory), confined(root, copy.images_directory)
        faults = image_faults(top, _digests(copy, sources), read=True)
        if not faults:
            return EpisodeFiles(root, copy.images_directory, {file: (top / file).stat().st_size for file in files}), []
        first_faults = first_faults or faults
    return None, first_faults


def _digests(copy: OtherEpisode, sources: Sequence[SourceRecord]) -> list[StepDigests]:
    return step_digests(sources[copy.other].record.connection, copy.number)


def _refuse(
    absent: Sequence[OtherEpisode],
    damaged: Sequence[tuple[OtherEpisode, list[ImageFault]]],
    sources: Sequence[SourceRecord],
) -> None:
    if absent:
        first = absent[0]
        raise RecordError(
            f"{sources[first.other].record.name} lacks the images of {len(absent)} of its episodes, the first of which "
            f"is {first.number} ({first.images_directory}); nothing was written",
            advice="copy them into its results directory, name the directories of a server's images with --images, or "
            "merge only the numbers with --without-images",
        )
    if damaged:
        raise RecordError(
            f"{sources[damaged[0][0].other].record.name} has missing or damaged images of {len(damaged)} of its "
            f"episodes: {'; '.join(_episode_lines(damaged))}; nothing was written",
            advice="restore the files, merge an intact copy, or merge only the numbers with --without-images",
        )


def _episode_lines(damaged: Sequence[tuple[OtherEpisode, list[ImageFault]]]) -> Iterator[str]:
    for new_episode, faults in damaged[:_NAMED]:
        yield f"episode {new_episode.number}: {_in_words(faults)}"
    if len(damaged) > _NAMED:
        yield f"and {len(damaged) - _NAMED} more"


def _in_words(faults: Sequence[ImageFault]) -> str:
    more = f" and {len(faults) - _NAMED} more files" if len(faults) > _NAMED else ""
    return ", ".join(str(fault) for fault in faults[:_NAMED]) + more
