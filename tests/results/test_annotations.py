from dataclasses import replace
from pathlib import Path

import pytest

from tests.results.records_of_a_lab import plan, run, stopped, void
from vsnbench.errors import UsageError
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.results.annotations import Annotation, read_annotation, read_tag, tags_of
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import count_episodes, episode_record, list_episodes
from vsnbench.results.writing.journal import Journal


@pytest.fixture
def journal(tmp_path: Path) -> Journal:
    """Two episodes: a success with a note of its judge, and a void attempt."""
    opened = Journal.open(sqlite_url(tmp_path / "vsnbench.db"))
    trials = opened.find_or_create_campaign(plan()).trials
    run(opened, trials[0], stopped(success=True))
    run(opened, trials[1], void())
    verdict = Verdict(EndReason.STOP, False, "judged again")
    opened.judge(1, verdict, author="ada", note="the Door stood 50% open")
    return opened


def found(journal: Journal, **fields: object) -> list[int]:
    selected = EpisodeFilter(**fields)  # type: ignore[arg-type]
    numbers = [episode.id for episode in list_episodes(journal.engine, selected)]
    assert count_episodes(journal.engine, selected) == len(numbers)
    return numbers


def test_the_latest_event_decides_whether_an_episode_has_a_tag(journal: Journal) -> None:
    journal.annotate([1, 2], Annotation(tags=("glare", "chair-moved")), author="ada")
    journal.annotate([1], Annotation(removed_tags=("glare", "never-there")), author="bob")
    assert [episode.tags for episode in list_episodes(journal.engine, EpisodeFilter())] == [
        ("chair-moved",), ("chair-moved", "glare"),
    ]  # fmt: skip
    assert found(journal, tags=("glare",)) == [2]
    assert found(journal, tags=("glare", "chair-moved")) == [2]
    assert found(journal, tags=("chair-moved",)) == [1, 2]
    journal.annotate([1], Annotation(tags=("glare",)), author="ada")
    assert found(journal, tags=("glare",)) == [1, 2]
    with journal.engine.connect() as connection:
        assert tags_of(connection, [1, 2, 99]) == {1: ("chair-moved", "glare"), 2: ("chair-moved", "glare")}


def test_a_tag_that_is_already_there_is_not_repeated(journal: Journal) -> None:
    for _ in range(2):
        journal.annotate([1], Annotation(tags=("glare",)), author="ada")
    events = episode_record(journal.engine, 1).events
    assert [(event.kind, event.text, event.author) for event in events] == [("tagged", "glare", "ada")]


def test_notes_are_found_in_any_case_and_change_no_verdict(journal: Journal) -> None:
    before = episode_record(journal.engine, 2)
    journal.annotate([2], Annotation(note="A visitor walked through"), author="ada")
    after = episode_record(journal.engine, 2)
    assert after.verdicts == before.verdicts
    assert replace(after, events=()) == replace(before, events=())
    assert found(journal, note="VISITOR") == [2]
    assert found(journal, note="door stood 50% o") == [1]
    assert found(journal, note="5%open") == found(journal, note="door_stood") == []


def test_an_unknown_episode_refuses_the_whole_change(journal: Journal) -> None:
    with pytest.raises(UsageError, match="episode 3"):
        journal.annotate([1, 3], Annotation(note="both"), author="ada")
    assert episode_record(journal.engine, 1).events == ()


@pytest.mark.parametrize("word", ["", "two words", "a,b", "x" * 41, "-dash", "_low", "<b>", "emoji😀", "a\nb"])
def test_what_is_no_tag_is_refused(word: str) -> None:
    with pytest.raises(UsageError) as refused:
        read_tag(word)
    assert refused.value.code == "invalid-tag"


def test_a_tag_is_read_in_lower_case_and_once() -> None:
    assert read_annotation(" seen ", ["Glare", "glare "]) == Annotation("seen", ("glare",))
    with pytest.raises(UsageError, match="both added and removed"):
        read_annotation("", ["glare"], ["GLARE"])
    with pytest.raises(UsageError) as refused:
        read_annotation("x" * 2001)
    assert refused.value.code == "long-note"
