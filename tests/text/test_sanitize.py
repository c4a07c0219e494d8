"""External text becomes a single printable line."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.text.sanitize import LONGEST_LINE, counted, error_line, sanitize, without_controls


def test_what_a_terminal_or_a_browser_would_act_on_is_shown() -> None:
    assert sanitize("a\x1b[0m\nb\u202ec\x00") == "a\\x1b[0m b\\u202ec\\x00"
    assert sanitize("a\u2028b\xa0c\ud800") == "a\\u2028b c\\ud800"
    assert sanitize("Gutiérrez 椅子 ²") == "Gutiérrez 椅子 ²"


@given(st.text(st.characters()))
def test_any_text_becomes_one_printable_line(text: str) -> None:
    assert sanitize(text).isprintable()
    assert sanitize(sanitize(text)) == sanitize(text)


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_json_without_controls_means_the_same(text: str) -> None:
    shown = without_controls(json.dumps(text, ensure_ascii=False))
    assert json.loads(shown) == text
    assert not set(shown) & {"\x1b", "\x9b", "\x07", "\u202e"}


class UnreadableError(Exception):
    def __str__(self) -> str:
        raise SystemExit("gone")


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (ValueError("bad\n  news"), "ValueError: bad news"),
        (KeyboardInterrupt(), "KeyboardInterrupt"),
        (UnreadableError(), "UnreadableError: (its message cannot be read: SystemExit)"),
        (ValueError("\ud800"), r"ValueError: \ud800"),
    ],
)
def test_an_error_is_one_line(error: BaseException, line: str) -> None:
    assert error_line(error) == line


def test_an_error_with_a_message_of_megabytes_is_cut() -> None:
    line = error_line(ValueError("\x00" * 10_000_000))
    assert len(line) == LONGEST_LINE
    assert line.endswith("…")


def test_a_number_goes_with_its_noun() -> None:
    assert (counted(1, "episode"), counted(0, "episode")) == ("1 episode", "0 episodes")
    assert [counted(number, "success is", "successes are") for number in (1, 2)] == ["1 success is", "2 successes are"]
