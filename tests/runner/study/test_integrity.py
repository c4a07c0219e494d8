"""Edits of a locked study by SQL are found by its lock, its log and the random draw."""

import json
import shutil
import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.results.locked_study import drawn, integrity, lock_drawn, note_of, run_ranks
from tests.results.records_of_a_lab import begun
from tests.results.studies_of_a_lab import hash_of
from tests.study.studies import study_text
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.studies.entries import RecordedStudy
from vsnbench.results.studies.log import event_hash, events_of
from vsnbench.results.studies.queries import studies
from vsnbench.results.writing.journal import Journal
from vsnbench.study.lock import LockNote
from vsnbench.study.schedule import Schedule

OF_THESE_CELLS = study_text(stopping="decided", about="these-cells")


@pytest.fixture
def empty(tmp_path: Path) -> Iterator[Journal]:
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as opened:
        yield opened


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of a study with 4 of 16 trials done, one judged again and one judgement retracted; tests copy it."""
    path = tmp_path_factory.mktemp("study") / "vsnbench.db"
    with Journal.open(sqlite_url(path)) as journal:
        run_ranks(journal, lock_drawn(journal), range(4))
        journal.judge(2, Verdict(EndReason.STOP, True, "it was in reach"), author="Eva")
        journal.judge(3, Verdict(EndReason.STOP, True, "a slip"), author="Eva")
        journal.retract_verdict(3, author="Eva", seen=2)
    return path


@pytest.fixture
def journal(database: Path, tmp_path: Path) -> Iterator[Journal]:
    with Journal.open(sqlite_url(shutil.copy(database, tmp_path / "vsnbench.db"))) as opened:
        yield opened


@pytest.fixture
def study(journal: Journal) -> RecordedStudy:
    (one,) = studies(journal.engine)
    return one


def change(journal: Journal, *statements: str) -> None:
    path = journal.engine.url.database
    assert path is not None
    with sqlite3.connect(path) as database:
        for statement in statements:
            assert database.execute(statement).rowcount > 0, statement


SWAPPED = (
    "UPDATE study_trial SET rank = -1 WHERE rank = 0",
    "UPDATE study_trial SET rank = 0 WHERE rank = 5",
    "UPDATE study_trial SET rank = 5 WHERE rank = -1",
)
NEARER = "UPDATE episode SET path_length_m = NULL, geodesic_end_m = 0 WHERE id = 1"
MOVED = "UPDATE episode SET trial_id = (SELECT trial_id FROM study_trial WHERE rank = 9) WHERE id = 1"
DELETED = tuple(f"DELETE FROM {table} WHERE {column} = 1" for table, column in (
    *(("step", "episode_id"), ("verdict", "episode_id"), ("episode", "id")),
))  # fmt: skip


@pytest.mark.parametrize(
    ("statements", "count", "named"),
    [
        (("UPDATE study_arm SET code = 'Z' WHERE code = 'A'",), 1, "was A and is Z"),
        (SWAPPED, 2, "trial 1 was arm "),
        (DELETED, 1, "an episode was deleted: arm "),
        (("UPDATE episode SET state = 'void' WHERE id = 1",), 1, "was judged and is void"),
        (("UPDATE verdict SET success = 0 WHERE episode_id = 1",), 1, "was a success and is a failure"),
        ((MOVED,), 1, " and is "),
        (("DELETE FROM verdict WHERE episode_id = 2 AND author = 'Eva'",), 1, "had 2 verdicts and has 1"),
        (("DELETE FROM study_event WHERE id = 2",), 2, "was deleted or edited"),
        (("DELETE FROM study_event WHERE id = (SELECT MAX(id) FROM study_event)",), 2, "newest event"),
        (("UPDATE study_event SET content = '{}' WHERE id = 3",), 1, "was edited"),
        (("DELETE FROM study_entry",), 1, "the history lacks what the log has: lock"),
        (("UPDATE study SET seed = 8",), 1, "seed was 7 in the plan and is 8"),
        (("UPDATE study SET blind = 0",), 1, "blind was True in the plan"),
        (("UPDATE study SET unblinded_at = locked_at",), 1, "unblinded without an entry"),
        (("UPDATE study SET schedule_sha256 = 'x'",), 1, "the schedule's hash was"),
        ((NEARER,), 1, "geodesic_end_m was nothing and is 0, path_length_m was 0.75 and is nothing, progress was "),
        (("UPDATE episode SET actions = 1 WHERE id = 1",), 1, "actions was 3 and is 1"),
        (("UPDATE episode SET started_at = '2026-01-01 00:00:00+00:00' WHERE id = 1",), 1, "started_at was"),
        (("UPDATE process SET operator = 'Zoe'",), 4, "operator was"),
        (("UPDATE model SET name = 'vlv' WHERE id = 1",), 1, "model 1: sha256"),
        (("UPDATE model SET weights_sha256 = 'f' WHERE id = 1",), 1, "model 1: sha256"),
        (("UPDATE campaign SET model_id = 3 - model_id",), 2, "campaign 1: key"),
        (("UPDATE site SET title = 'Another cell'",), 1, "site 1: title"),
    ],
)  # fmt: skip
def test_a_change_of_a_locked_study_is_found(
    journal: Journal, study: RecordedStudy, statements: tuple[str, ...], count: int, named: str
) -> None:
    note = note_of(journal, study)
    assert integrity(journal, study.uuid, note).differences == ()
    change(journal, *statements)
    found = integrity(journal, study.uuid, note).differences
    assert len(found) == count, found
    assert any(named in words for words in found), found
    assert not any("one" in words.split() or "two" in words.split() for words in found), "the study is blind"


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("arms", [["a"]]),
        ("arms", 3),
        ("arm", [1]),
        ("repetition", "x"),
        ("state", [2]),
        ("verdicts", "x"),
        ("verdicts", -5),
        ("verdict", 7),
        ("verdict", {"success": [1]}),
    ],
)
def test_a_malformed_log_with_new_hashes_is_found(
    journal: Journal, study: RecordedStudy, field: str, value: Any
) -> None:
    with journal.engine.connect() as connection:
        events = events_of(connection, study.id)
    for event in events:
        content = json.loads(event.content)
        if field in content:
            text = json.dumps({**content, field: value})
            sha256 = event_hash(event.created_at, event.kind, text, event.previous)
            change(
                journal,
                f"UPDATE study_event SET content = '{text}', sha256 = '{sha256}' WHERE sha256 = '{event.sha256}'",
            )
    assert integrity(journal, study.uuid, note_of(journal, study)).differences


def test_a_log_of_outcomes_without_measurements_stays_readable(journal: Journal, study: RecordedStudy) -> None:
    with journal.engine.connect() as connection:
        events = events_of(connection, study.id)
    hashes = {"": ""}
    for event in events:
        content = json.loads(event.content)
        older = json.dumps({name: content[name] for name in content if name not in ("version", "measured")})
        previous = hashes[event.previous]
        hashes[event.sha256] = event_hash(event.created_at, event.kind, older, previous)
        change(
            journal,
            f"UPDATE study_event SET content = '{older}', previous = '{previous}', sha256 = '{hashes[event.sha256]}' "
            f"WHERE sha256 = '{event.sha256}'",
        )
    change(journal, f"UPDATE study SET log_heads = '{hashes[events[-1].sha256]}'")
    checked = integrity(journal, study.uuid)
    assert checked.differences == ()
    assert [words[:34] for words in checked.remarks] == ["4 episodes logged by an older vers"]
    run_ranks(journal, study, range(4, 6))
    change(
        journal, "UPDATE verdict SET success = 0 WHERE episode_id = 1", "UPDATE episode SET actions = 9 WHERE id > 4"
    )
    assert len(integrity(journal, study.uuid).differences) == 3, "old verdicts and new measurements are compared"


def test_a_lock_file_with_another_schedule_is_found(journal: Journal, study: RecordedStudy) -> None:
    note = replace(note_of(journal, study), schedule_sha256="0" * 64)
    assert len(integrity(journal, study.uuid, note).differences) == 1


def test_a_changed_alpha_with_a_new_hash_is_found(journal: Journal, study: RecordedStudy) -> None:
    text = f"{study.content.rstrip()}\nalpha: 0.2\n"
    change(journal, f"UPDATE study SET content = '{text.replace(chr(39), chr(39) * 2)}', sha256 = '{hash_of(text)}'")
    assert len(integrity(journal, study.uuid).differences) == 1


def test_the_lock_file_shows_a_removed_log(journal: Journal, study: RecordedStudy) -> None:
    note = note_of(journal, study)
    change(journal, "DELETE FROM study_event", "UPDATE study SET log_heads = ''")
    assert integrity(journal, study.uuid, note).differences != ()
    older = LockNote(study.uuid, study.sha256, "", "")
    checked = integrity(journal, study.uuid, older)
    assert checked.differences == ()
    assert [words.partition(":")[0] for words in checked.remarks] == ["locked by an older version"]
    run_ranks(journal, study, range(4, 6))
    assert integrity(journal, study.uuid, older).differences == (), "a study of an older version continues"
    change(journal, "UPDATE verdict SET success = 1 - success WHERE episode_id = 5")
    assert len(integrity(journal, study.uuid, older).differences) == 1, "later trials are chained"


@pytest.mark.parametrize("text", [OF_THESE_CELLS, study_text()], ids=["these cells", "whole plan"])
def test_an_order_that_was_not_drawn_is_found_despite_valid_hashes(empty: Journal, text: str) -> None:
    fair = drawn(text)
    # A planted order: the same arm first in every block.
    first = min(fair.codes)
    planted = sorted(fair.trials, key=lambda one: (one.block, one.arm != first))
    schedule = Schedule(tuple(replace(one, rank=rank) for rank, one in enumerate(planted)), fair.codes)
    assert schedule.fingerprint != fair.fingerprint
    study = lock_drawn(empty, text, schedule)
    found = integrity(empty, study.uuid, note_of(empty, study)).differences
    assert any("not the random draw from seed 7" in words for words in found)
    assert len(found) == 1 + sum(a != b for a, b in zip(fair.trials, schedule.trials, strict=True))


BY_STARTS = study_text(stopping="decided", about="cells-like-these")


def test_a_study_of_starting_positions_may_hold_the_older_order_of_blocks(empty: Journal) -> None:
    locked = lock_drawn(empty, BY_STARTS, drawn(OF_THESE_CELLS))
    assert integrity(empty, locked.uuid, note_of(empty, locked)).differences == ()


def test_a_sequential_study_of_these_cells_may_not_run_start_by_start(empty: Journal) -> None:
    locked = lock_drawn(empty, OF_THESE_CELLS, drawn(BY_STARTS))
    found = integrity(empty, locked.uuid, note_of(empty, locked)).differences
    assert any("not the random draw" in words for words in found)


def test_a_missing_episode_is_a_remark_and_a_released_claim_is_not(journal: Journal, study: RecordedStudy) -> None:
    for _ in range(2):
        claim = journal.claim_next(study.arms[0].campaign_id, [journal.study_progress(study.id)[-1].trial.id]) or (
            journal.claim_next(study.arms[1].campaign_id, [journal.study_progress(study.id)[-1].trial.id])
        )
        assert claim is not None
        assert journal.release(claim.id)
    assert integrity(journal, study.uuid).remarks == ()
    standing = journal.study_progress(study.id)[6]
    other = begun(journal, standing.trial)
    change(journal, f"DELETE FROM episode WHERE id = {other.id}")
    checked = integrity(journal, study.uuid)
    assert checked.differences == ()
    assert len(checked.remarks) == 1
    assert f"episode {other.id} of this record" in checked.remarks[0]
