"""JSON of unknown origin: its numbers can be used by any other code."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.files.bounded_json import LONGEST_INTEGER, parse_json

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**30), 10**30) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(VALUES)
def test_json_is_read_as_the_standard_library_reads_it(value: object) -> None:
    text = json.dumps(value)
    assert parse_json(text) == json.loads(text) == parse_json(text.encode())


@pytest.mark.parametrize(("digits", "read"), [(LONGEST_INTEGER, int), (LONGEST_INTEGER + 1, float), (4000, float)])
def test_a_long_integer_is_a_floating_point_number(digits: int, read: type) -> None:
    (number,) = parse_json(f"[{'9' * digits}]")
    assert type(number) is read
    assert math.isfinite(number) == (digits < 300)
    assert parse_json(f'{{"id": "{"9" * digits}", "n": -{"9" * digits}}}')["id"] == "9" * digits


@pytest.mark.parametrize("text", ["", "{", b"\xff", '"\\ud8'])
def test_what_is_not_json_is_a_value_error(text: str | bytes) -> None:
    with pytest.raises(ValueError):
        parse_json(text)
