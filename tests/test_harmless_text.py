"""Text from outside: one printable line, whatever was in it."""

from hypothesis import given
from hypothesis import strategies as st

from vsnbench.harmless_text import harmless


def test_what_a_terminal_or_a_browser_would_act_on_is_shown() -> None:
    assert harmless("a\x1b[0m\nb\u202ec\x00") == "a\\x1b[0m b\\u202ec\\x00"
    assert harmless("a\u2028b\xa0c\ud800") == "a\\u2028b c\\ud800"
    assert harmless("Gutiérrez 椅子 ²") == "Gutiérrez 椅子 ²"


@given(st.text(st.characters()))
def test_any_text_becomes_one_printable_line(text: str) -> None:
    assert harmless(text).isprintable()
    assert harmless(harmless(text)) == harmless(text)
