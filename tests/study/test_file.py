from pathlib import Path

import pytest

from vsnbench.errors import StudyError
from vsnbench.study.file import parse_study, read_text
from vsnbench.study.template import StudyDraft


def test_the_template_is_a_study_whatever_its_words_hold() -> None:
    draft = StudyDraft(
        title='a "quoted" # title: with {braces}',
        question="naïve?\n- no",
        arms={"il": "pirlnav", "x.y": "lab.policy:Policy"},
        goals=["bed", "chair"],
        operators=["Eva: 1"],
    )
    study = parse_study(draft.text("s.yaml"), "s.yaml")
    assert study.title == 'a "quoted" # title: with {braces}'
    assert study.question == "naïve?\n- no"
    assert list(study.arms) == ["il", "x.y"]
    assert study.operators == ("Eva: 1",)
    assert study.blind


def test_a_file_that_is_not_there_or_no_text_is_a_line(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"No such file.*study new"):
        read_text(tmp_path / "none.yaml")
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(StudyError, match="not UTF-8 text"):
        read_text(tmp_path / "bytes.yaml")


def test_a_carriage_return_is_a_change_like_any_other(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_bytes(b"title: x\r\n")
    assert read_text(tmp_path / "s.yaml") == "title: x\r\n"
