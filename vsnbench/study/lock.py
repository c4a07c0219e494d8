"""The lock of a study: the note beside its file, how a file differs from what was locked, and what may still change."""

import difflib
import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

from vsnbench.errors import StudyError
from vsnbench.harmless_text import harmless
from vsnbench.study.file import StudyFile
from vsnbench.whole_files import write_whole

SUFFIX = ".lock"
FROZEN = (
    *("arms", "goals", "site", "robot", "noise", "pretend_real"),
    *("starting_positions", "repetitions", "protocol", "order", "seed", "blind"),
)
"""Fields that stay as they were locked: with others it is another experiment."""
JUDGING = ("primary", "stopping", "about", "alpha", "margin")
"""Fields that say how the answer is found: changed after the first result, the conclusion says so."""


@dataclass(frozen=True, slots=True)
class LockNote:
    """What lies beside a locked file; the record itself is what counts."""

    study: str
    """The study's identity in the record (a UUID)."""
    sha256: str
    """Of the file as it was locked, or last amended."""
    locked_at: str
    database: str
    """Where it was locked, without a password; for people."""


def sha256_of(text: str) -> str:
    """Return the hash of a file's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def note_path(file: Path) -> Path:
    """Return where the note of a study's file lies."""
    return file.with_name(file.name + SUFFIX)


def read_note(file: Path) -> LockNote | None:
    """Return the note beside a file; None where there is none.

    Raises:
        StudyError: it cannot be read, or somebody wrote in it.
    """
    path = note_path(file)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return LockNote(**{name: str(content[name]) for name in LockNote.__dataclass_fields__})
    except FileNotFoundError:
        return None
    except OSError as problem:
        raise StudyError(f"cannot read {path}: {problem.strerror or problem}") from problem
    except (ValueError, TypeError, KeyError, RecursionError) as problem:
        raise StudyError(f"{path} is not what `vsnbench study lock` wrote: restore it, or remove it") from problem


def write_note(file: Path, note: LockNote) -> None:
    """Write the note beside a file, whole or not at all.

    Raises:
        RecordError: it cannot be written.
    """
    write_whole(note_path(file), (json.dumps(asdict(note), indent=2) + "\n").encode())


def changes(locked: str, now: str) -> tuple[str, ...]:
    """Return the lines in which a text differs from the locked one, as `-old` and `+new`; empty where they are equal.

    A difference that shows in no line (the end of the last one, a carriage return) is named in words.
    """
    if locked == now:
        return ()
    lines = difflib.unified_diff(locked.splitlines(), now.splitlines(), n=0, lineterm="")
    told = tuple(line for line in lines if line[:1] in "+-" and line[:3] not in ("---", "+++"))
    return told or ("invisible: the ends of lines",)


def first_change(locked: str, now: str) -> str:
    """Name the first line that differs, in a few words; empty for equal texts."""
    if locked == now:
        return ""
    before, after = locked.splitlines(), now.splitlines()
    for number, (old, new) in enumerate(zip(before, after, strict=False), start=1):
        if old != new and _short(old) == _short(new):
            return f"line {number}, in its comment or blanks"
        if old != new:
            return f"line {number} is `{_short(new)}`, and was `{_short(old)}`"
    if len(after) > len(before):
        return f"line {len(before) + 1} is new: `{_short(after[len(before)])}`"
    if len(after) < len(before):
        return f"line {len(after) + 1} is gone: `{_short(before[len(after)])}`"
    return "the ends of its lines"


_LONGEST = 60


def _short(line: str) -> str:
    """Return a line's content; its comment only where there is nothing else."""
    content = line.strip()
    before, _, _ = content.partition(" #")
    told = harmless(before.strip() or content)
    return told if len(told) <= _LONGEST else f"{told[: _LONGEST - 1]}…"


def check_amendment(before: StudyFile, after: StudyFile) -> None:
    """Refuse a change of what was drawn.

    Raises:
        StudyError: a frozen field was changed.
    """
    changed = changed_fields(before, after, FROZEN)
    if changed:
        names = ", ".join(changed)
        raise StudyError(
            f"{names}: no amendment can change what the schedule was drawn from; restore it, and lock a new study for "
            "another one"
        )


def changed_fields(before: StudyFile, after: StudyFile, among: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the fields, of these, that differ."""
    return tuple(name for name in among if getattr(before, name) != getattr(after, name))
