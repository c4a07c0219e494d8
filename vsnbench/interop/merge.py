"""Merges results of several labs, machines or days into one record: rows and files, all or nothing.

The other record is not trusted: its rows are validated, and files are copied only from inside its directory. Files are
copied under a temporary name first; one transaction moves them into place with their rows.
"""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from zipfile import is_zipfile

from sqlalchemy import Connection

from vsnbench.errors import RecordError, UsageError
from vsnbench.files.home import expanded
from vsnbench.files.temporary import ScratchDirectory
from vsnbench.interop.merge_files import FilePlan, Progress, SourceRecord, plan_files, repair_file
from vsnbench.results.database_url import parse_url, redacted_url, sqlite_path, sqlite_url
from vsnbench.results.files.directory import DATABASE_NAME, LOW_SPACE_BYTES, ResultsDirectory
from vsnbench.results.files.staged_import import StagedImport, files_below, remove_stale_imports
from vsnbench.results.merging.episodes import OtherRecord
from vsnbench.results.merging.plan import MergePlan, plan_merge
from vsnbench.results.merging.sources import open_other
from vsnbench.results.reading.queries import images_directories
from vsnbench.results.schema.engine import opened_engine, reading, transaction
from vsnbench.results.schema.migrate import create_record, open_record, record_in_memory, upgrade
from vsnbench.results.writing.journal import Journal


@dataclass(frozen=True, slots=True)
class MergeSource:
    """Location of another record."""

    name: str
    """As given by the user, without a password."""
    database_url: str
    files: Path | None
    """Its results directory; None for a database without one."""
    images: tuple[Path, ...] = ()
    """Results directories of the machines that wrote to a server's database; each has the files of its episodes."""

    def root_of(self, directory: str) -> Path | None:
        """Return the results directory with the files of an episode; None if there is none.

        Raises:
            RecordError: several directories have them.
        """
        places = [self.files] if self.files is not None else list(self.images)
        found = [place for place in places if files_below(place, directory)]
        if len(found) > 1:
            raise RecordError(
                f"{found[0]} and {found[1]} both have {directory} of {self.name}, so one of them belongs to another "
                "record; nothing was written",
                advice="name only the directories of runs with this database",
            )
        return found[0] if found else None


@dataclass(frozen=True, slots=True)
class MergeResult:
    """Result of a merge or of a dry run."""

    plan: MergePlan
    others: tuple[MergeSource, ...]
    files: FilePlan
    without_files: int
    """Number of episodes that are added without their images, on request."""

    @property
    def changes(self) -> bool:
        """Whether anything is or would be written."""
        return self.plan.changes or bool(self.files.repairs)


def merge_source(given: str, images: Sequence[Path] = ()) -> MergeSource:
    """Return the source for a results directory, an SQLite file in one, or a database URL.

    Args:
        given: argument of the user.
        images: results directories with the files of a server's episodes.

    Raises:
        UsageError: it is none of these.
        RecordError: the directory does not exist or contains no record.
    """
    if absent := next((place for place in images if not place.is_dir()), None):
        raise RecordError(f"the image directory {absent} does not exist", advice="name a results directory of a run")
    if "://" in given:
        parse_url(given)
        file = sqlite_path(given)
        if file is None:
            return MergeSource(redacted_url(given), given, None, tuple(images))
        return MergeSource(redacted_url(given), given, file.parent)
    path = expanded(given)
    file = path / DATABASE_NAME if path.is_dir() else path
    if not file.is_file():
        raise RecordError(f"no record at {file}", advice="name a results directory with its database and episodes")
    if is_zipfile(file):
        raise RecordError(
            f"{file} is an archive", advice="unzip it and name the results directory in it", code="archive-given"
        )
    return MergeSource(given, sqlite_url(file), file.parent)


def merge(
    target: ResultsDirectory,
    others: Sequence[MergeSource],
    *,
    without_images: bool = False,
    dry_run: bool = False,
    progress: Progress = lambda _what, _done, _of: None,
) -> MergeResult:
    """Merge the campaigns and episodes of other records into one; existing data stay unchanged.

    Raises:
        UsageError: a record would be merged into itself.
        RecordError: a record cannot be used, records contradict each other, or images are missing or damaged; nothing
            was written.
    """
    _check_apart(target, others)
    with ExitStack() as stack:
        scratch = stack.enter_context(ScratchDirectory("merge")).path
        records = [_opened(stack, other, scratch / str(place)) for place, other in enumerate(others)]
        if not dry_run and _exists(target):
            create_record(target.database_url)
            with opened_engine(target.database_url) as engine:
                upgrade(engine)
        with _reading(target) as mine:
            plan = plan_merge(mine, records)
        sources = [SourceRecord(record, other.root_of) for other, record in zip(others, records, strict=True)]
        files = plan_files(plan, sources, target.path, without_images=without_images, progress=progress)
        without_files = sum(
            1 for episode in plan.new_episodes if episode.images_directory and episode.uuid not in files.arriving
        )
        merged = MergeResult(plan, tuple(others), files, without_files)
        if not dry_run and merged.changes:
            _write(target, records, merged, progress)
    return merged


def _check_apart(target: ResultsDirectory, others: Sequence[MergeSource]) -> None:
    mine = sqlite_path(target.database_url)
    for other in others:
        file = sqlite_path(other.database_url)
        if mine is None and file is None:
            same = parse_url(other.database_url) == parse_url(target.database_url)
        else:
            same = mine is not None and file is not None and file.resolve() == mine.resolve()
        if same:
            raise UsageError(f"{other.name} is the target of the merge itself", advice="name another record")
        if any(place.resolve() == target.path.resolve() for place in (other.files, *other.images) if place is not None):
            raise UsageError(
                f"{other.name} keeps its images in {target.path}, which is the target of the merge",
                advice="name another directory with --results",
            )
    named = [other.name for other in others]
    if twice := sorted({name for name in named if named.count(name) > 1}):
        raise UsageError(f"{twice[0]} is named twice", advice="name each record once")


def _opened(stack: ExitStack, other: MergeSource, scratch: Path) -> OtherRecord:
    scratch.mkdir()
    return stack.enter_context(open_other(other.database_url, other.name, scratch))


def _exists(target: ResultsDirectory) -> bool:
    file = sqlite_path(target.database_url)
    return file is None or file.is_file()


@contextmanager
def _reading(target: ResultsDirectory) -> Iterator[Connection]:
    """Yield a snapshot of the record, or of an empty one if it does not exist."""
    opened = open_record(target.database_url) if _exists(target) else record_in_memory()
    with opened as engine, transaction(reading(engine)) as connection:
        yield connection


def _write(target: ResultsDirectory, records: Sequence[OtherRecord], merged: MergeResult, progress: Progress) -> None:
    plan, files = merged.plan, merged.files
    target.prepare()
    if (free := target.free_bytes()) < files.size_bytes + LOW_SPACE_BYTES:
        raise RecordError(
            f"the disk of {target.path} has only {free / 1e9:.1f} GB left, and the images need "
            f"{files.size_bytes / 1e9:.1f} GB",
            advice="nothing was written; free some space, or merge into a record on another disk",
        )
    attached = {uuid: repair for uuid, repair in files.repairs.items() if not repair.directory}
    with Journal.open(target.database_url) as journal:
        kept = partial(images_directories, journal.engine)
        remove_stale_imports(target.path, kept)
        with StagedImport(target.path, kept) as coming:
            done = 0
            for uuid, source in (files.arriving | {uuid: repair.source for uuid, repair in attached.items()}).items():
                coming.copy(uuid, source.root, source.directory, source.sizes)
                done += sum(source.sizes.values())
                progress("copying images", done, files.size_bytes)
            for repair in files.repairs.values():
                for file in repair.files if repair.directory else ():
                    done += repair_file(target.path, repair, file)
                    progress("copying images", done, files.size_bytes)
            written = 0

            def place(uuid: str, directory: str) -> None:
                nonlocal written
                coming.place(uuid, directory)
                written += 1
                progress("writing episodes", written, len(files.arriving))

            if plan.changes:
                journal.merge(records, [new_episode.uuid for new_episode in plan.new_episodes], files.arriving, place)
            if attached:
                journal.attach_images({uuid: repair.number for uuid, repair in attached.items()}, coming.place)
