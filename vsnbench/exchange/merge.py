"""Makes the results of two labs, two machines or two days one record: rows and files, all of it or nothing.

The other record is not believed: its rows are looked through, and its files are followed to their ends and copied only
from inside it. Files come first, under a temporary name; one transaction puts them in place with their rows.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from sqlalchemy import Connection, Engine

from vsnbench.database.engine import open_engine, reading, record_errors
from vsnbench.database.journal import Journal
from vsnbench.database.merge_plan import Arrival, MergePlan, OtherRecord, plan_merge
from vsnbench.database.migrate import open_record, upgrade
from vsnbench.database.other_records import open_other
from vsnbench.database.queries import images_directories
from vsnbench.database_url import parse_url, shown_url, sqlite_path, sqlite_url
from vsnbench.errors import RecordError, UsageError
from vsnbench.record.arrivals import Arrivals, files_below, sweep_arrivals
from vsnbench.record.results import DATABASE_NAME, LOW_SPACE_BYTES, ResultsDirectory
from vsnbench.scratch import ScratchDirectory

Told = Callable[[str, int, int], None]
"""Is told what is being done, how much of it is done, and of how much."""


@dataclass(frozen=True, slots=True)
class OtherPlace:
    """Where another record lies."""

    name: str
    """As it was typed, without a password."""
    database_url: str
    files: Path | None
    """Its results directory; None for a database alone."""


@dataclass(frozen=True, slots=True)
class Merged:
    """What a merge did, or would do."""

    plan: MergePlan
    others: tuple[OtherPlace, ...]
    files: int
    file_bytes: int
    without_files: int
    """Episodes that had images there, and come without them because that was asked for."""


def other_place(given: str) -> OtherPlace:
    """Return what a results directory, an SQLite file in one, or a database URL stands for.

    Raises:
        UsageError: it is none of them.
        RecordError: there is no such directory, or it has no record in it.
    """
    if "://" in given:
        parse_url(given)
        file = sqlite_path(given)
        return OtherPlace(shown_url(given), given, None if file is None else file.parent)
    path = Path(given).expanduser()
    file = path / DATABASE_NAME if path.is_dir() else path
    if not file.is_file():
        raise RecordError(
            f"there is no record at {file}", advice="name a results directory, with its database and its episodes"
        )
    return OtherPlace(given, sqlite_url(file), file.parent)


def merge(
    target: ResultsDirectory,
    others: Sequence[OtherPlace],
    *,
    without_images: bool = False,
    dry_run: bool = False,
    told: Told = lambda _what, _done, _of: None,
) -> Merged:
    """Bring the campaigns and episodes of other records into one; what it has already is left as it is.

    Args:
        target: the record that grows; it is made if there is none.
        others: where the others lie.
        without_images: take in episodes whose images are not there, without them.
        dry_run: only say what would come in; nothing is written.
        told: of progress.

    Raises:
        UsageError: a record is to be merged into itself.
        RecordError: one cannot be used, they contradict each other, or images are missing; nothing was written.
    """
    _check_apart(target, others)
    with ExitStack() as stack:
        scratch = stack.enter_context(ScratchDirectory("merge")).path
        records = [_opened(stack, other, scratch / str(place)) for place, other in enumerate(others)]
        if not dry_run and _exists(target):
            _upgrade(target)
        with _reading(target) as mine:
            plan = plan_merge(mine, records)
        found = _files(plan, others, without_images=without_images)
        merged = Merged(
            plan,
            tuple(others),
            files=sum(len(sizes) for sizes in found.values()),
            file_bytes=sum(sum(sizes.values()) for sizes in found.values()),
            without_files=sum(1 for one in plan.arrivals if one.images_directory and one.uuid not in found),
        )
        if not dry_run and plan.changes:
            _write(target, others, records, merged, found, told)
    return merged


_Sizes = dict[Path, int]
"""The files of an episode, relative to its directory, with their sizes in bytes."""


def _check_apart(target: ResultsDirectory, others: Sequence[OtherPlace]) -> None:
    mine = sqlite_path(target.database_url)
    for other in others:
        file = sqlite_path(other.database_url)
        if mine is None and file is None:
            same = parse_url(other.database_url) == parse_url(target.database_url)
        else:
            same = mine is not None and file is not None and file.resolve() == mine.resolve()
        if same:
            raise UsageError(f"{other.name} is this very record", advice="name another one to merge into it")
        if other.files is not None and other.files.resolve() == target.path.resolve():
            raise UsageError(
                f"{other.name} keeps its images in {target.path}, where the merged record's would go",
                advice="name another directory with --results",
            )
    named = [other.name for other in others]
    if twice := sorted({name for name in named if named.count(name) > 1}):
        raise UsageError(f"{twice[0]} is named twice", advice="name each record once")


def _opened(stack: ExitStack, other: OtherPlace, scratch: Path) -> OtherRecord:
    scratch.mkdir()
    return stack.enter_context(open_other(other.database_url, other.name, scratch))


def _exists(target: ResultsDirectory) -> bool:
    file = sqlite_path(target.database_url)
    return file is None or file.is_file()


def _upgrade(target: ResultsDirectory) -> None:
    engine = open_engine(target.database_url)
    try:
        upgrade(engine)
    finally:
        engine.dispose()


@contextmanager
def _reading(target: ResultsDirectory) -> Iterator[Connection]:
    """Give the record as it is now; an empty one where there is none yet."""
    opened = open_record(target.database_url) if _exists(target) else _empty_record()
    with opened as engine, record_errors(engine), reading(engine).begin() as connection:
        yield connection


@contextmanager
def _empty_record() -> Iterator[Engine]:
    engine = open_engine("sqlite://")
    try:
        upgrade(engine)
        yield engine
    finally:
        engine.dispose()


def _files(plan: MergePlan, others: Sequence[OtherPlace], *, without_images: bool) -> dict[str, _Sizes]:
    """Return the files of each arrival that has any.

    Raises:
        RecordError: an episode had images, and they are not there; or its record leads out of its directory.
    """
    found: dict[str, _Sizes] = {}
    missing: list[Arrival] = []
    for arrival in plan.arrivals:
        if not arrival.images_directory:
            continue
        root = others[arrival.other].files
        files = [] if root is None else files_below(root, arrival.images_directory)
        if root is None or not files:
            missing.append(arrival)
        else:
            top = root / arrival.images_directory
            found[arrival.uuid] = {file: (top / file).stat().st_size for file in files}
    if missing and not without_images:
        first = missing[0]
        raise RecordError(
            f"{others[first.other].name} has no images of {len(missing)} of its episodes, the first of them "
            f"{first.number} ({first.images_directory}), so nothing was written",
            advice="copy them beside its database, or take the numbers alone with --without-images",
        )
    return found


def _write(
    target: ResultsDirectory,
    others: Sequence[OtherPlace],
    records: Sequence[OtherRecord],
    merged: Merged,
    found: dict[str, _Sizes],
    told: Told,
) -> None:
    target.prepare()
    if (free := target.free_bytes()) < merged.file_bytes + LOW_SPACE_BYTES:
        raise RecordError(
            f"the disk of {target.path} has only {free / 1e9:.1f} GB left, the images to come need "
            f"{merged.file_bytes / 1e9:.1f} GB",
            advice="nothing was written; free some space, or merge into a record elsewhere",
        )
    arrivals = merged.plan.arrivals
    with Journal.open(target.database_url) as journal:
        kept = partial(images_directories, journal.engine)
        sweep_arrivals(target.path, kept)
        with Arrivals(target.path, kept) as coming:
            done = 0
            for arrival in arrivals:
                root = others[arrival.other].files
                if root is not None and arrival.uuid in found:
                    coming.copy(arrival.uuid, root, arrival.images_directory, found[arrival.uuid])
                    done += sum(found[arrival.uuid].values())
                    told("copying images", done, merged.file_bytes)
            written = 0

            def place(arrival: Arrival, directory: str) -> None:
                nonlocal written
                coming.place(arrival.uuid, directory)
                written += 1
                told("writing episodes", written, len(found))

            journal.merge(records, [arrival.uuid for arrival in arrivals], found, place)
