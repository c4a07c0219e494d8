"""Typed answers: typing errors never become verdicts."""

import pytest

from vsnbench.runner.operator.answers import (
    MisreadError,
    TypedAnswer,
    parse_confirmation,
    parse_distance,
    parse_touched,
)


@pytest.mark.parametrize("answer", ["no", "No\n", "n", "nothing", "Nothing.", "none", "no collision"])
def test_several_words_mean_no_collision(answer: str) -> None:
    assert parse_touched(answer) is TypedAnswer.NOTHING


@pytest.mark.parametrize("answer", ["", "\n", "  ", "yes"])
def test_an_empty_answer_does_not_tell_what_was_touched(answer: str) -> None:
    with pytest.raises(MisreadError):
        parse_touched(answer)


def test_other_text_names_what_was_touched() -> None:
    assert parse_touched(" the table's   leg\n") == "the table's leg"
    assert parse_touched("later") is TypedAnswer.LATER


def test_a_distance_is_kept_only_by_its_word() -> None:
    assert parse_distance("keep") is TypedAnswer.KEEP
    assert parse_distance("later") is TypedAnswer.LATER
    assert parse_distance(" 0.84 m\n") == "0.84 m"
    with pytest.raises(MisreadError):
        parse_distance(" ")


def test_only_yes_confirms() -> None:
    assert parse_confirmation("Yes\n")
    assert not parse_confirmation("no")
    for answer in ("", "maybe", "yy"):
        with pytest.raises(MisreadError):
            parse_confirmation(answer)
