"""Finds the recorded study of a study file, and differences between file and record."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote

from vsnbench.errors import RecordError, StudyError
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.reading.read_model import HIDDEN
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.studies.entries import RecordedStudy
from vsnbench.results.studies.evidence import read_evidence
from vsnbench.results.studies.queries import directories_of, studies
from vsnbench.runner.study.integrity import StudyIntegrity, check_integrity
from vsnbench.study.file import StudyFile, parse_study, read_text
from vsnbench.study.lock import LockNote, first_change, note_path, read_note, sha256_of, write_note

_MAX_DIFFERENCES = 3
"""Number of differences in an error message."""


@dataclass(frozen=True, slots=True)
class OpenedStudy:
    """A locked study: its file and what the record has."""

    file: Path
    results: ResultsDirectory
    recorded: RecordedStudy
    plan: StudyFile
    """The plan in the record, as locked or last amended."""
    changed: str
    """How the file, or the record's copy, differs from what was locked; empty without differences."""
    integrity: StudyIntegrity
    """How the record differs from the lock and the log."""

    @property
    def refusal(self) -> str:
        """Why no trial may run, with the fix; empty if nothing was changed."""
        if self.lacks_note:
            return f"{self.changed}: restore it, or write it again with `vsnbench study lock {self.file}`"
        if self.integrity.differences:
            found = "; ".join(self.integrity.differences[:_MAX_DIFFERENCES])
            more = len(self.integrity.differences) - _MAX_DIFFERENCES
            others = f"; and {more} more (`vsnbench study status {self.file}`)" if more > 0 else ""
            return f"the record was changed outside of vsnbench: {found}{others}; restore a backup of it"
        if self.changed:
            return (
                f"{self.changed}; restore it, or record the change with `vsnbench study amend {self.file} --reason ...`"
            )
        return ""

    @property
    def lacks_note(self) -> bool:
        """Whether the lock file is missing."""
        return read_note(self.file) is None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of `status` and `report`, one line each."""
        found = tuple(
            f"the record was changed outside of vsnbench: {difference}" for difference in self.integrity.differences
        )
        own = (self.refusal,) if self.changed and not found else (self.changed,) if self.changed else ()
        return (*own, *found, *self.integrity.remarks)


def open_study(file: Path, results: Path | None, db: str | None) -> OpenedStudy:
    """Find the study of a file in the record.

    Raises:
        StudyError: the file cannot be read, is not locked, or was locked in another record.
        RecordError: the record cannot be read.
    """
    text = read_text(file)
    note = read_note(file)
    place = ResultsDirectory.locate(results, db)
    elsewhere = f"{file} is locked in another record, {note.database}: give it with --results or --db" if note else ""
    lock = f"vsnbench study lock {quote(str(file))}{place.options}"
    unlocked = f"{file} is not locked in {place.database_label}: lock it with `{lock}`"
    known = _studies_in(place)
    recorded = next((study for study in known if note is not None and study.uuid == note.study), None)
    if recorded is None:  # no lock file, or the study was locked elsewhere and merged into this record
        same = {sha256_of(text), note.sha256 if note else ""}
        recorded = next((study for study in known if same & {study.sha256, study.locked_sha256}), None)
    if recorded is None:
        raise StudyError(elsewhere or unlocked)
    with open_record(place.database_url) as engine:
        evidence = read_evidence(engine, recorded.id)
    _check_note(file, text, note, recorded, known)
    plan = parse_study(recorded.content, f"{file} as it was locked")
    integrity = check_integrity(recorded, evidence, plan, note)
    if integrity.differences and note is not None and note.sha256 == sha256_of(text) and text != recorded.content:
        # The file is as it was locked, so its lines show what was changed in the record's copy.
        change = first_change(text, recorded.content)
        named = f"the plan: {HIDDEN if recorded.reveals_arm(change) else change}"
        integrity = replace(integrity, differences=(named, *integrity.differences))
        return OpenedStudy(file, place, recorded, plan, "", integrity)
    return OpenedStudy(file, place, recorded, plan, _changed(file, text, note, recorded), integrity)


def _check_note(
    file: Path, text: str, note: LockNote | None, recorded: RecordedStudy, known: Sequence[RecordedStudy]
) -> None:
    """Refuse the lock file of another study.

    Raises:
        StudyError: the record has the study of the file, and the lock file belongs to another one.
    """
    if note is None:
        return
    now, other = sha256_of(text), ""
    if now not in (recorded.sha256, recorded.locked_sha256):
        if any(now in (study.sha256, study.locked_sha256) for study in known):
            other = f"the study {recorded.title!r}"
    elif note.study != recorded.uuid and note.sha256 not in (recorded.sha256, recorded.locked_sha256):
        other = "another study"  # not in this record
    if other:
        raise StudyError(
            f"{note_path(file)} belongs to {other} and not to {file}: restore the right file, or delete it and "
            f"write it again with `vsnbench study lock {file}`"
        )


def write_lock_file(file: Path, results: ResultsDirectory, identity: str) -> RecordedStudy:
    """Write the lock file of a study from the record, and return the study.

    Raises:
        RecordError: the record cannot be read, or the file cannot be written.
    """
    with open_record(results.database_url) as engine:
        recorded = next(study for study in studies(engine) if study.uuid == identity)
        log = read_evidence(engine, recorded.id).log
    first = next((event.sha256 for event in log if not event.parents), "")
    locked_at = recorded.locked_at.isoformat()
    write_note(
        file,
        LockNote(
            *(recorded.uuid, recorded.sha256, locked_at, results.database_label),
            schedule_sha256=recorded.schedule_sha256,
            event_sha256=first,
        ),
    )
    return recorded


def study_of_file(text: str, results: ResultsDirectory) -> RecordedStudy | None:
    """Return the recorded study whose locked or amended text this is, if there is one.

    Raises:
        RecordError: the record cannot be read.
    """
    known, sha256 = _studies_in(results), sha256_of(text)
    return next((study for study in known if sha256 in (study.sha256, study.locked_sha256)), None)


def _studies_in(results: ResultsDirectory) -> tuple[RecordedStudy, ...]:
    """Return the studies of a record; none if there is no record."""
    try:
        with open_record(results.database_url) as engine:
            return studies(engine)
    except RecordError as problem:
        if "no record at" in str(problem):
            return ()
        raise


def remove_blind_copies(results: ResultsDirectory, identity: str) -> None:
    """Remove Rerun copies that were made while a study was blind; `vsnbench view` makes complete ones.

    Raises:
        RecordError: the record cannot be read.
    """
    from vsnbench.viewer.recording import FILE_NAME

    with open_record(results.database_url) as engine:
        for directory in directories_of(engine, identity):
            (results.episode_directory(directory) / FILE_NAME).unlink(missing_ok=True)


def _changed(file: Path, text: str, note: LockNote | None, recorded: RecordedStudy) -> str:
    if note is None:
        return f"{note_path(file)} is missing"
    if change := first_change(recorded.content, text):
        if recorded.reveals_arm(change):
            change = f"{' '.join(change.split()[:2])}, which names a model and is {HIDDEN}"
        return f"{file} was changed after it was locked: {change}"
    if note.sha256 != recorded.sha256:
        return f"{note_path(file)} was changed: it does not name what was locked"
    return ""
