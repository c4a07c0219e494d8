"""Notes and tags of episodes: events that anyone may add at any time, and that change no verdict.

An episode has a tag if the latest event about it is not its removal. Events are append-only; merging unites them.
"""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from sqlalchemy import ColumnElement, Connection, exists, insert, select

from vsnbench.errors import UsageError
from vsnbench.results.schema.row_encoding import event_row, parts
from vsnbench.results.schema.tables import EpisodeRow, EventRow, VerdictRow
from vsnbench.text.sanitize import sanitize

NOTE: Final = "note"
TAGGED: Final = "tagged"
UNTAGGED: Final = "untagged"
MAX_NOTE_CHARACTERS: Final = 2000
_TAG = re.compile(r"[^\W_][\w.:-]{0,39}")


@dataclass(frozen=True, slots=True)
class Annotation:
    """Changes to the notes and tags of episodes."""

    note: str = ""
    tags: tuple[str, ...] = ()
    removed_tags: tuple[str, ...] = ()


def read_tag(typed: str) -> str:
    """Return a tag in lower case.

    Raises:
        UsageError: it is not a word of at most 40 letters, digits and `_ . : -`.
    """
    tag = typed.strip().lower()
    if not _TAG.fullmatch(tag):
        raise UsageError(
            f"{sanitize(typed)[:60]!r} is not a tag",
            advice="a tag is one word of at most 40 letters, digits and _ . : -, like chair-moved",
            code="invalid-tag",
        )
    return tag


def read_annotation(note: str, tags: Sequence[str] = (), removed_tags: Sequence[str] = ()) -> Annotation:
    """Check what someone typed.

    Raises:
        UsageError: the note is too long, a word is not a tag, or a tag is both added and removed.
    """
    added, removed = (tuple(dict.fromkeys(map(read_tag, words))) for words in (tags, removed_tags))
    if both := [tag for tag in added if tag in removed]:
        raise UsageError(f"tag {both[0]} is both added and removed", advice="leave one of them out")
    if len(note) > MAX_NOTE_CHARACTERS:
        raise UsageError(
            f"the note has {len(note):,} characters", advice=f"write at most {MAX_NOTE_CHARACTERS:,}", code="long-note"
        )
    return Annotation(note.strip(), added, removed)


def annotate(connection: Connection, episode_ids: Collection[int], annotation: Annotation, author: str) -> None:
    """Append notes and changed tags within a transaction; see `Journal.annotate`.

    A tag that the episode already has, or no longer has, is not repeated.
    """
    known = set(connection.scalars(select(EpisodeRow.id).where(EpisodeRow.id.in_(list(episode_ids)))))
    if missing := [number for number in episode_ids if number not in known]:
        raise UsageError(
            f"episode {missing[0]} does not exist",
            advice="nothing was written; `vsnbench episodes list` lists the episodes",
            code="unknown-episode",
        )
    present = tags_of(connection, episode_ids)
    rows = []
    for number in episode_ids:
        tags = present.get(number, ())
        changes = [(NOTE, annotation.note)] if annotation.note else []
        changes += [(TAGGED, tag) for tag in annotation.tags if tag not in tags]
        changes += [(UNTAGGED, tag) for tag in annotation.removed_tags if tag in tags]
        rows += [event_row(kind, words, author=author, episode_id=number) for kind, words in changes]
    if rows:
        connection.execute(insert(EventRow), rows)


def tags_of(connection: Connection, episode_ids: Iterable[int]) -> dict[int, tuple[str, ...]]:
    """Return the tags of those of these episodes that have some, in alphabetical order."""
    latest: dict[int, dict[str, bool]] = {}
    for some in parts(episode_ids):
        query = (
            select(EventRow.episode_id, EventRow.text, EventRow.kind)
            .where(EventRow.episode_id.in_(some), EventRow.kind.in_([TAGGED, UNTAGGED]))
            .order_by(EventRow.created_at, EventRow.id)
        )
        for number, tag, kind in connection.execute(query):
            if number is not None:
                latest.setdefault(number, {})[tag] = kind == TAGGED
    found = {number: tuple(sorted(tag for tag, on in tags.items() if on)) for number, tags in latest.items()}
    return {number: tags for number, tags in found.items() if tags}


def has_tag(tag: str) -> ColumnElement[bool]:
    """Return the condition that an episode has a tag."""
    latest = (
        select(EventRow.kind)
        .where(EventRow.episode_id == EpisodeRow.id, EventRow.kind.in_([TAGGED, UNTAGGED]), EventRow.text == tag)
        .order_by(EventRow.created_at.desc(), EventRow.id.desc())
        .limit(1)
        .correlate(EpisodeRow)
        .scalar_subquery()
    )
    return latest == TAGGED


def has_note(words: str) -> ColumnElement[bool]:
    """Return the condition that a note, or the note of a verdict, contains these words in any case."""
    note = exists().where(
        EventRow.episode_id == EpisodeRow.id, EventRow.kind == NOTE, EventRow.text.icontains(words, autoescape=True)
    )
    judged = exists().where(VerdictRow.episode_id == EpisodeRow.id, VerdictRow.note.icontains(words, autoescape=True))
    return note.correlate(EpisodeRow) | judged.correlate(EpisodeRow)
