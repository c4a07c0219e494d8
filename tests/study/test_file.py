import re
from pathlib import Path

import pytest

from tests.study.studies import small_study, study_text
from vsnbench.errors import StudyError
from vsnbench.study.file import parse_study, read_text
from vsnbench.study.template import StudyDraft

BAD = {
    "one arm": ({"arms": {"one": {"model": "random"}}}, "compares at least two models"),
    "the same model twice": (
        {"arms": {"a1": {"model": "random"}, "a2": {"model": "random"}}},
        "a1 and a2 are the same model with the same settings",
    ),
    "thirteen arms": ({"arms": {f"a{n}": {"model": f"m:{n}"} for n in range(13)}}, "at most 12"),
    "an unknown key": ({"colour": "red"}, "colour: unknown field"),
    "a goal that is no name": ({"goals": ["A unicorn!"]}, "unknown goal 'A unicorn!'"),
    "a shared goal that is an arm's own too": (
        {"arms": {"one": {"model": "random", "goals": ["bed"]}, "two": {"model": "forward"}}},
        "bed is already a shared goal",
    ),
    "decided in no random order": (
        {"stopping": "decided", "about": "these-cells", "order": "as-planned"},
        "requires order: blocks",
    ),
    "decided without a subject": ({"stopping": "decided"}, "requires about: these-cells"),
    "a rate of an unknown arm": ({"primary": {"kind": "rate", "arm": "three", "rate": 0.5}}, "unknown arm three"),
    "percent for a share": (
        {"power": 80},
        "power: must be below 1, got 80",
    ),
    "goals that are no list": ({"goals": "chair"}, "goals: expected a list, got 'chair': write [chair]"),
    "arms that are a list": (
        {"arms": ["vlv"]},
        "arms: expected a mapping, got a list: give each entry a name and",
    ),
    "starts as a list": (
        {"starting_positions": [1, 2]},
        "starting_positions: expected text, got a list",
    ),
    "a metric that is none": ({"primary": {"metric": "spl"}}, "metric: 'spl' is not allowed"),
    "progress against a rate": (
        {"primary": {"kind": "rate", "arm": "one", "rate": 0.5, "metric": "progress"}},
        "metric: unknown field",
    ),
    "another kind of analysis": ({"primary": {"kind": "sr"}}, "unknown kind 'sr'"),
    "an order that is none": ({"order": "block"}, "order: 'block' is not allowed: did you mean blocks?"),
    "a name that is none": ({"arms": {"a b": {"model": "x"}, "two": {"model": "y"}}}, "letters, digits"),
}


@pytest.mark.parametrize(("changes", "words"), BAD.values(), ids=BAD.keys())
def test_what_a_study_cannot_be_is_refused_in_a_line_that_names_the_place(
    changes: dict[str, object], words: str
) -> None:
    with pytest.raises(StudyError) as refused:
        small_study(**changes)
    assert words in str(refused.value)
    assert re.match(r"study\.yaml:\d+: ", str(refused.value))
    assert "\n" not in str(refused.value)


def test_an_unknown_key_of_an_arm_is_named_with_its_line() -> None:
    text = study_text(arms={"one": {"model": "random", "wieghts": "x"}, "two": {"model": "forward"}})
    with pytest.raises(StudyError, match=r"study\.yaml:6: arms\.one\.wieghts: unknown field"):
        parse_study(text, "study.yaml")


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
