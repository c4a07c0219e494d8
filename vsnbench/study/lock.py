"""Lock of a study: the lock note of its file, changes since the lock, and permitted amendments."""

import difflib
import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

from vsnbench.errors import StudyError
from vsnbench.files.atomic import write_atomic
from vsnbench.files.bounded_json import parse_json
from vsnbench.study.file import StudyFile
from vsnbench.text.sanitize import sanitize

SUFFIX = ".lock"
FROZEN = (
    *("arms", "goals", "site", "robot", "noise", "rehearse"),
    *("starting_positions", "repetitions", "real_cells", "protocol", "order", "seed", "blind"),
)
"""Fields that cannot be amended, because they define the experiment."""
JUDGING = ("primary", "stopping", "about", "test", "looks", "spending", "alpha", "margin")
"""Fields of the analysis; a change after the first result is stated in the conclusion."""


@dataclass(frozen=True, slots=True)
class LockNote:
    """Note next to a locked file; the record is authoritative."""

    study: str
    """UUID of the study."""
    sha256: str
    """SHA-256 of the file as locked or last amended."""
    locked_at: str
    database: str
    """Database of the lock, without a password; for information only."""
    schedule_sha256: str = ""
    """SHA-256 of the schedule with the codes; empty in files of older versions."""
    event_sha256: str = ""
    """SHA-256 of the first event of the study's log; empty in files of older versions."""


def sha256_of(text: str) -> str:
    """Return the SHA-256 of a file's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def note_path(file: Path) -> Path:
    """Return the path of the note of a study file."""
    return file.with_name(file.name + SUFFIX)


def read_note(file: Path) -> LockNote | None:
    """Return the note of a file; None if there is none.

    Raises:
        StudyError: the note cannot be read or was edited.
    """
    path = note_path(file)
    try:
        content = parse_json(path.read_text(encoding="utf-8"))
        required = {name: str(content[name]) for name in ("study", "sha256", "locked_at", "database")}
        return LockNote(
            **required, **{name: str(content.get(name, "")) for name in ("schedule_sha256", "event_sha256")}
        )
    except FileNotFoundError:
        return None
    except OSError as problem:
        raise StudyError(f"cannot read {path}: {problem.strerror or problem}") from problem
    except (ValueError, TypeError, KeyError, RecursionError) as problem:
        raise StudyError(f"{path} was not written by `vsnbench study lock`: restore it, or remove it") from problem


def write_note(file: Path, note: LockNote) -> None:
    """Write the note of a file atomically.

    Raises:
        RecordError: the note cannot be written.
    """
    write_atomic(note_path(file), (json.dumps(asdict(note), indent=2) + "\n").encode())


def changes(locked: str, now: str) -> tuple[str, ...]:
    """Return the changed lines as `-old` and `+new`; empty for equal texts.

    Differences that are not visible in a line, such as line endings, are described.
    """
    if locked == now:
        return ()
    lines = difflib.unified_diff(locked.splitlines(), now.splitlines(), n=0, lineterm="")
    changed = tuple(line for line in lines if line[:1] in "+-" and line[:3] not in ("---", "+++"))
    return changed or ("invisible: line endings",)


def first_change(locked: str, now: str) -> str:
    """Return a short description of the first changed line, or an empty string."""
    if locked == now:
        return ""
    before, after = locked.splitlines(), now.splitlines()
    for number, (old, new) in enumerate(zip(before, after, strict=False), start=1):
        if old != new and _short(old) == _short(new):
            return f"line {number}, in a comment or blanks"
        if old != new:
            return f"line {number} is `{_short(new)}`, and was `{_short(old)}`"
    if len(after) > len(before):
        return f"line {len(before) + 1} was added: `{_short(after[len(before)])}`"
    if len(after) < len(before):
        return f"line {len(after) + 1} was removed: `{_short(before[len(after)])}`"
    return "line endings"


_LONGEST = 60


def _short(line: str) -> str:
    """Return a line without its comment, unless there is nothing else."""
    content = line.strip()
    before, _, _ = content.partition(" #")
    shown = sanitize(before.strip() or content)
    return shown if len(shown) <= _LONGEST else f"{shown[: _LONGEST - 1]}…"


def check_amendment(before: StudyFile, after: StudyFile) -> None:
    """Check that an amendment changes no frozen field.

    Raises:
        StudyError: a frozen field was changed.
    """
    changed = [name for name in FROZEN if getattr(before, name) != getattr(after, name)]
    if changed:
        raise StudyError(
            f"{', '.join(changed)}: fields that determine the schedule cannot be amended; restore them, and lock a new "
            "study for another plan"
        )
