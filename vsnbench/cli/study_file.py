"""Finds the study that a file is, and says where the file and the record disagree."""

from dataclasses import dataclass
from pathlib import Path

from vsnbench.database.blinding import HIDDEN
from vsnbench.database.migrate import open_record
from vsnbench.database.study_entries import RecordedStudy
from vsnbench.database.study_queries import directories_of, find_study, studies
from vsnbench.errors import RecordError, StudyError
from vsnbench.record.results import ResultsDirectory
from vsnbench.study.file import StudyFile, parse_study, read_text
from vsnbench.study.lock import first_change, note_path, read_note, sha256_of

DEFAULT_FILE = Path("study.yaml")


@dataclass(frozen=True, slots=True)
class OpenedStudy:
    """A locked study, as its file, the note beside it and the record know it."""

    file: Path
    results: ResultsDirectory
    recorded: RecordedStudy
    plan: StudyFile
    """What was locked, or last amended: the record's word, whatever became of the file."""
    changed: str
    """In what the file, or the record's own copy, is not what was locked; empty when all is."""

    @property
    def refusal(self) -> str:
        """What to do about a change."""
        return (
            f"{self.changed}; restore it, or say why with `vsnbench study amend {self.file} --reason ...`"
            if self.changed
            else ""
        )


def open_study(file: Path, results: Path | None, db: str | None) -> OpenedStudy:
    """Find the study of a file in the record.

    Raises:
        StudyError: the file cannot be read, is not locked, or was locked in another record.
        RecordError: the record cannot be read.
    """
    text = read_text(file)
    note = read_note(file)
    place = ResultsDirectory.locate(results, db)
    elsewhere = f"{file} was locked in another record, {note.database}: name it with --results or --db" if note else ""
    unlocked = f"{file} is not locked in {place.shown_database}: `vsnbench study lock {file}` does it"
    try:
        with open_record(place.database_url) as engine:
            recorded = find_study(engine, note.study) if note is not None else None
            if recorded is None:  # no note; or it was locked elsewhere too, and merged into this record
                same = {sha256_of(text), note.sha256 if note else ""}
                recorded = next((one for one in studies(engine) if same & {one.sha256, one.locked_sha256}), None)
    except RecordError as problem:
        if "no record at" in str(problem):
            raise StudyError(elsewhere or unlocked) from problem
        raise
    if recorded is None:
        raise StudyError(elsewhere or unlocked)
    plan = parse_study(recorded.content, f"{file} as it was locked")
    return OpenedStudy(file, place, recorded, plan, _changed(file, text, recorded))


def forget_blind_copies(results: ResultsDirectory, identity: str) -> None:
    """Remove the copies for Rerun that were made while a study was blind: `vsnbench view` makes them again, whole.

    Raises:
        RecordError: the record cannot be read.
    """
    from vsnbench.viewer.recording import FILE_NAME

    with open_record(results.database_url) as engine:
        for directory in directories_of(engine, identity):
            (results.episode_directory(directory) / FILE_NAME).unlink(missing_ok=True)


def _changed(file: Path, text: str, recorded: RecordedStudy) -> str:
    if sha256_of(recorded.content) != recorded.sha256:
        return f"the copy of {file} in the record itself was changed after it was locked"
    if change := first_change(recorded.content, text):
        if recorded.gives_away(change):
            change = f"{' '.join(change.split()[:2])}, which names a model and is {HIDDEN}"
        return f"{file} was changed after it was locked: {change}"
    note = read_note(file)
    if note is not None and note.sha256 != recorded.sha256:
        return f"{note_path(file)} was changed: it does not name what was locked"
    return ""
