"""Writes a bundle: one archive with the part of a record, its images, tables and report, and a hash of every file."""

import io
import os
import re
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from sqlalchemy import Connection, func, select

from vsnbench import __version__
from vsnbench.errors import RecordError, UsageError
from vsnbench.evidence.bundle.archive import FORMAT_FILE, MANIFEST, SIGNATURES, format_line, manifest_lines
from vsnbench.evidence.bundle.croissant import CROISSANT, croissant
from vsnbench.evidence.bundle.derived_files import TABLES, write_derived_files
from vsnbench.evidence.bundle.readme import BundleAbout, readme
from vsnbench.evidence.bundle.record_cut import cut_record
from vsnbench.evidence.bundle.selection import BundleSelection
from vsnbench.evidence.bundle.signatures import sign
from vsnbench.evidence.bundle.stored_zip import StoredFile, StoredZipWriter
from vsnbench.evidence.bundle.weights import find_scans_by_hash, find_weights_by_hash
from vsnbench.files.atomic import atomic_file
from vsnbench.files.temporary import ScratchDirectory
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.confined_paths import confined
from vsnbench.results.files.directory import DATABASE_NAME, ResultsDirectory
from vsnbench.results.files.image_set import image_faults
from vsnbench.results.files.staged_import import files_below
from vsnbench.results.merging.episodes import step_digests
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.schema.study_tables import Study
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, ModelRow, VerdictRow
from vsnbench.settings.user_config import BundleConfig
from vsnbench.study.lock import LockNote
from vsnbench.text.sanitize import counted, sanitize

Progress = Callable[[str, int, int], object]
"""Called with the kind of work, the amount done and the total."""
_EPISODE_FILE = re.compile(
    r"(rgb/\d+(-[a-z]+)?\.jpg|depth/\d+(-[a-z]+)?\.png|film/\d+-\d+\.jpg|trajectory\.tum)", re.ASCII
)
"""Files of an episode that belong to a bundle; the copy for Rerun is made from them."""


@dataclass(frozen=True, slots=True)
class BundleRequest:
    """What to bundle and how."""

    select: Callable[[Connection], BundleSelection]
    """Returns the campaigns, or refuses them."""
    about: BundleConfig
    note: LockNote | None = None
    """Lock note of the study, if there is one."""
    with_images: bool = True
    with_weights: bool = False
    with_scan: bool = False
    key: Path | None = None
    """SSH key that signs the manifest."""


@dataclass(frozen=True, slots=True)
class BundleSummary:
    """What a bundle contains."""

    path: Path
    size_bytes: int
    files: int
    campaigns: int
    episodes: int
    manifest_sha256: str
    """Identifies the content."""
    signed: bool


def make_bundle(
    results: ResultsDirectory,
    request: BundleRequest,
    output: Path,
    progress: Progress = lambda _what, _done, _of: None,
) -> BundleSummary:
    """Write a bundle; the file appears when it is complete.

    Raises:
        UsageError: the file exists, or the selection must not be bundled.
        RecordError: the record cannot be read, images are missing, or the file cannot be written.
    """
    if output.exists() or output.is_symlink():
        raise UsageError(f"{output} already exists", advice="name a new file", code="file-exists")
    if request.key is not None:
        sign(b"", request.key)  # an unusable key is reported before the work
    with ExitStack() as stack:
        stage = stack.enter_context(ScratchDirectory("bundle")).path
        progress("reading the record", 0, 3)
        with open_record(results.database_url) as engine, transaction(reading(engine)) as source:
            selection = request.select(source)
            content = stage / "content"
            (content / "results").mkdir(parents=True)
            database = content / "results" / DATABASE_NAME
            cut_record(source, selection, database, with_images=request.with_images)
        progress("reading the record", 1, 3)
        write_derived_files(content / "results", content, request.note)
        progress("reading the record", 3, 3)
        engine = stack.enter_context(open_record(sqlite_url(database)))
        connection = stack.enter_context(reading(engine).begin())
        part = stack.enter_context(atomic_file(output))
        manifest = stack.enter_context((stage / MANIFEST).open("w", encoding="ascii"))
        with part.open("w+b") as file, StoredZipWriter(file) as archive:
            bundle = _Bundle(stage, results.path, connection, archive, manifest)
            return bundle.write(request, output, progress)


class _Bundle:
    """One bundle that is written."""

    def __init__(
        self, stage: Path, results: Path, connection: Connection, archive: StoredZipWriter, manifest: TextIO
    ) -> None:
        self._stage = stage
        self._results = results
        self._connection = connection
        self._archive = archive
        self._manifest = manifest
        self._files = 0

    def write(self, request: BundleRequest, output: Path, progress: Progress) -> BundleSummary:
        """Write all files."""
        about = _about(self._connection, request.about)
        episodes = self._connection.execute(
            select(EpisodeRow.id, EpisodeRow.images_directory).order_by(EpisodeRow.id)
        ).all()
        self._add_bytes(FORMAT_FILE, format_line())
        self._add_bytes("README.md", readme(about, with_images=request.with_images).encode())
        tables = {}
        content = self._stage / "content"
        for path in sorted(path for path in content.rglob("*") if path.is_file()):
            stored = self._add_file(path.relative_to(content).as_posix(), path)
            if path.parent.name == TABLES:
                tables[path.stem] = stored
        added = find_weights_by_hash(self._connection) if request.with_weights else {}
        added |= find_scans_by_hash(self._connection) if request.with_scan else {}
        for name, path in added.items():
            self._add_file(name, path.resolve())
        self._add_bytes(CROISSANT, croissant(about, tables).encode())
        for done, (number, directory) in enumerate(episodes, start=1):
            progress("copying images", done, len(episodes))
            if directory:
                self._add_episode(number, directory)
        self._manifest.flush()
        with (self._stage / MANIFEST).open("rb") as manifest:
            stored = self._archive.add(MANIFEST, manifest, os.fstat(manifest.fileno()).st_size)
        if request.key is not None:
            signature = sign((self._stage / MANIFEST).read_bytes(), request.key)
            self._archive.add(f"{SIGNATURES}/{MANIFEST}.sig", io.BytesIO(signature), len(signature))
        size = self._archive.close()
        campaigns = self._connection.scalar(select(func.count(CampaignRow.id))) or 0
        signed = request.key is not None
        return BundleSummary(output, size, self._files, campaigns, len(episodes), stored.sha256, signed)

    def _add_bytes(self, name: str, content: bytes) -> None:
        self._listed(self._archive.add(name, io.BytesIO(content), len(content)))

    def _add_file(self, name: str, path: Path | str) -> StoredFile:
        with open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK), "rb") as file:  # noqa: PTH123
            return self._listed(self._archive.add(name, file, os.fstat(file.fileno()).st_size))

    def _listed(self, added: StoredFile) -> StoredFile:
        self._manifest.write(manifest_lines([(added.name, added.sha256)]))
        self._files += 1
        return added

    def _add_episode(self, number: int, directory: str) -> None:
        """Copy the files of an episode as they are."""
        top = confined(self._results, directory)
        names = (path.as_posix() for path in files_below(self._results, directory))
        for name in names:
            if _EPISODE_FILE.fullmatch(name):
                self._add_file(f"results/{directory}/{name}", f"{top}/{name}")
        # After the copy, when the files are in memory: checked before, each would be read from the disk twice.
        if faults := image_faults(top, step_digests(self._connection, number), read=False):
            raise RecordError(
                f"episode {number}: {faults[0]} in {top}",
                advice="restore the file, or bundle only the numbers with --without images",
                code="missing-images",
            )


def _about(connection: Connection, given: BundleConfig) -> BundleAbout:
    """Describe the content from the record alone."""
    study = connection.scalar(select(Study.title))
    models = connection.scalars(select(ModelRow.name).distinct().order_by(ModelRow.name)).all()
    episodes = connection.scalar(select(func.count(EpisodeRow.id))) or 0
    campaigns = connection.scalar(select(func.count(CampaignRow.id))) or 0
    newest = [
        connection.scalar(select(func.max(column)))
        for column in (EpisodeRow.ended_at, VerdictRow.created_at, Study.unblinded_at)
    ]
    date = f"{max(moment for moment in newest if moment is not None):%Y-%m-%d}"
    what = f"{counted(episodes, 'episode')} of {', '.join(map(sanitize, models))}"
    title = sanitize(study) if study else f"Results of vsnbench: {what}"
    return BundleAbout(
        title=title,
        description=f"{what} in {counted(campaigns, 'campaign')}: record, tables and report of vsnbench {__version__}.",
        date=date,
        authors=tuple(name.strip() for name in (given.author or "").split(";") if name.strip()),
        licence=given.licence or "",
        citation=given.citation or f"{given.author + ': ' if given.author else ''}{title} ({date[:4]})",
    )
