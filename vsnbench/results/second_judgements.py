"""Second judgements of episodes: events of raters who did not see the first verdict. They change no verdict.

The latest answer of a rater about an episode counts, unless it was retracted. Merging unites them, as other events.
"""

from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Final

from sqlalchemy import Connection, insert, select

from vsnbench.errors import UsageError
from vsnbench.results.reading.read_model import COUNTS, episodes_of_trials
from vsnbench.results.schema.row_encoding import event_row, parts
from vsnbench.results.schema.tables import EpisodeRow, EventRow, SessionRow, VerdictRow
from vsnbench.results.writing.lifecycle import EpisodeState

PERSON: Final = "person"
_RETRACTED: Final = "second_retracted"


class Outcome(StrEnum):
    """Outcome of a judgement."""

    SUCCESS = "success"
    FAILURE = "failure"
    VOID = "void"

    @classmethod
    def of(cls, success: bool | None) -> "Outcome":
        """Return the outcome of a verdict."""
        return cls.VOID if success is None else cls.SUCCESS if success else cls.FAILURE


_KINDS: Final = {f"second_{outcome}": outcome for outcome in Outcome}


@dataclass(frozen=True, slots=True)
class SecondJudgement:
    """Answer of a rater about an episode."""

    episode: int
    rater: str
    outcome: Outcome
    text: str
    """What the rater saw, and a note."""
    created_at: datetime


def is_same_person(name: str, other: str) -> bool:
    """Whether two names are the same except for case and spaces."""
    return person_key(name) == person_key(other)


def person_key(name: str) -> str:
    """Return a name in lower case with single spaces."""
    return " ".join(name.split()).casefold()


def judged_episodes(connection: Connection) -> dict[int, str]:
    """Return the number and UUID of each judged episode with images that counts for its trial."""
    query = episodes_of_trials(EpisodeRow.id, EpisodeRow.uuid).where(COUNTS, EpisodeRow.images_directory != "")
    return {row.id: row.uuid for row in connection.execute(query)}


def first_judges(connection: Connection, episodes: Collection[int]) -> dict[int, frozenset[str]]:
    """Return who has judged these episodes or was the operator of their session."""
    found: dict[int, set[str]] = {}
    for some in parts(episodes):
        judges = select(VerdictRow.episode_id, VerdictRow.author)
        judges = judges.where(VerdictRow.source == PERSON, VerdictRow.episode_id.in_(some))
        operators = select(EpisodeRow.id, SessionRow.operator).join(SessionRow, SessionRow.id == EpisodeRow.session_id)
        operators = operators.where(EpisodeRow.id.in_(some))
        for query in (judges, operators):
            for number, name in connection.execute(query):
                found.setdefault(number, set()).add(name)
    return {number: frozenset(names) for number, names in found.items()}


def add_second_judgement(connection: Connection, episode: int, rater: str, outcome: Outcome, words: str) -> None:
    """Append a rater's answer within a transaction; see `Journal.judge_second`."""
    state = connection.scalar(select(EpisodeRow.state).where(EpisodeRow.id == episode))
    if state is None:
        raise UsageError(
            f"episode {episode} does not exist",
            advice="`vsnbench episodes list` lists the episodes",
            code="unknown-episode",
        )
    if state not in (EpisodeState.JUDGED.value, EpisodeState.VOID.value):
        raise UsageError(
            f"episode {episode} has no first judgement", advice=f"`vsnbench judge {episode}`", code="no-first-judgement"
        )
    if any(is_same_person(rater, name) for name in first_judges(connection, [episode]).get(episode, ())):
        raise UsageError(
            f"episode {episode}: {rater} has judged it or was its operator",
            advice="a second judgement is another person's",
            code="first-judge",
        )
    connection.execute(insert(EventRow), event_row(f"second_{outcome}", words, author=rater, episode_id=episode))


def retract_second_judgement(connection: Connection, episode: int, rater: str) -> None:
    """Retract a rater's answer within a transaction; the answer stays in the events. See `Journal.retract_second`."""
    if not any(is_same_person(rater, given.rater) for given in second_judgements(connection, [episode])):
        raise UsageError(
            f"episode {episode} has no second judgement by {rater}",
            advice="nothing to retract",
            code="no-second-judgement",
        )
    connection.execute(insert(EventRow), event_row(_RETRACTED, "", author=rater, episode_id=episode))


def second_judgements(connection: Connection, episodes: Collection[int] | None = None) -> tuple[SecondJudgement, ...]:
    """Return the latest answer of each rater about each of these episodes, or about all, by episode and rater."""
    latest: dict[tuple[int, str], SecondJudgement | None] = {}
    query = select(EventRow.episode_id, EventRow.kind, EventRow.author, EventRow.text, EventRow.created_at)
    query = query.where(EventRow.kind.in_([*_KINDS, _RETRACTED]))
    for some in [None] if episodes is None else parts(episodes):
        part = query if some is None else query.where(EventRow.episode_id.in_(some))
        for number, kind, rater, words, at in connection.execute(part.order_by(EventRow.created_at, EventRow.id)):
            outcome = _KINDS.get(kind)
            if number is not None:
                given = SecondJudgement(number, rater, outcome, words, at) if outcome is not None else None
                latest[number, person_key(rater)] = given
    return tuple(given for _, given in sorted(latest.items()) if given is not None)
