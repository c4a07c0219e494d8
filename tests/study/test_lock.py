from pathlib import Path

import pytest

from tests.study.studies import small_study
from vsnbench.errors import StudyError
from vsnbench.study.lock import LockNote, changes, check_amendment, first_change, note_path, read_note, write_note

TEXT = "title: a\nmargin: 0.1  # points\nseed: 7\n"


@pytest.mark.parametrize(
    ("now", "words"),
    [
        (TEXT.replace("0.1", "0.2"), "line 2 is `margin: 0.2`, and was `margin: 0.1`"),
        (TEXT + "notes: x\n", "line 4 was added: `notes: x`"),
        (TEXT.replace("seed: 7\n", ""), "line 3 was removed: `seed: 7`"),
        (TEXT.replace("# points", "# Points"), "line 2, in a comment or blanks"),
        (TEXT.rstrip("\n"), "line endings"),
        (TEXT.replace("\n", "\r\n"), "line endings"),
    ],
)
def test_one_changed_byte_is_noticed_and_named(now: str, words: str) -> None:
    assert first_change(TEXT, now) == words
    assert changes(TEXT, now) != ()
    assert first_change(TEXT, TEXT) == ""


def test_the_note_beside_a_file_is_read_back_and_a_broken_one_is_a_line(tmp_path: Path) -> None:
    file = tmp_path / "study.yaml"
    note = LockNote("u", "s", "now", "r/vsnbench.db")
    assert read_note(file) is None
    write_note(file, note)
    assert read_note(file) == note
    note_path(file).write_text("[]")
    with pytest.raises(StudyError, match="was not written by `vsnbench study lock`"):
        read_note(file)


def test_an_amendment_changes_words_and_never_what_was_drawn() -> None:
    check_amendment(small_study(), small_study(notes="the second operator is ill", alpha=0.01))
    with pytest.raises(StudyError, match="goals, seed: fields that determine the schedule"):
        check_amendment(small_study(), small_study(goals=["bed"], seed=8))
