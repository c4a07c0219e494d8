"""What is typed by accident is no verdict, and what is meant is understood."""

import pytest

from tests.runner.stand_ins import APARTMENT
from vsnbench.runner.answers import MisreadError, Said, confirmed, diagonal_m, measured_m, what_was_touched


@pytest.mark.parametrize("answer", ["no", "No\n", "n", "nothing", "Nothing.", "none", "no collision"])
def test_nothing_in_many_words_is_no_collision(answer: str) -> None:
    assert what_was_touched(answer) is Said.NOTHING


@pytest.mark.parametrize("answer", ["", "\n", "  ", "yes"])
def test_enter_alone_says_nothing_about_a_collision(answer: str) -> None:
    with pytest.raises(MisreadError):
        what_was_touched(answer)


def test_anything_else_is_what_it_touched() -> None:
    assert what_was_touched(" the table's   leg\n") == "the table's leg"
    assert what_was_touched("later") is Said.LATER


@pytest.mark.parametrize(
    ("answer", "metres"), [("0.84", 0.84), ("0,84 m", 0.84), ("84 cm", 0.84), ("84cm\n", 0.84), (".5", 0.5), ("3", 3.0)]
)
def test_a_distance_is_read_in_metres_or_as_centimetres_that_say_so(answer: str, metres: float) -> None:
    assert measured_m(answer, APARTMENT) == pytest.approx(metres)


@pytest.mark.parametrize("answer", ["84", "15", "8400 cm"])
def test_what_is_longer_than_the_site_is_no_distance_in_it(answer: str) -> None:
    assert diagonal_m(APARTMENT) < 15
    with pytest.raises(MisreadError, match=r"more than the \d+ m that there are"):
        measured_m(answer, APARTMENT)


def test_a_bare_84_is_told_what_it_would_be() -> None:
    with pytest.raises(MisreadError, match=r"centimetres, write 0\.84"):
        measured_m("84", APARTMENT)


@pytest.mark.parametrize("answer", ["", "near", "-1", "nan", "inf", "1e3", "0x1", "1.2.3", "0.84 km"])
def test_what_is_no_distance_is_asked_for_again(answer: str) -> None:
    with pytest.raises(MisreadError):
        measured_m(answer, APARTMENT)


def test_an_estimate_is_kept_only_in_a_word() -> None:
    assert measured_m("keep", APARTMENT) is Said.KEEP
    assert measured_m("later", APARTMENT) is Said.LATER


def test_only_yes_is_yes() -> None:
    assert confirmed("Yes\n")
    assert not confirmed("no")
    for answer in ("", "maybe", "yy"):
        with pytest.raises(MisreadError):
            confirmed(answer)
