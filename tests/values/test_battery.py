"""Battery reports of a base: only measurements count, and they are printed unchanged."""

import math

import pytest

from vsnbench.values.battery import Battery, course_of


@pytest.mark.parametrize(
    ("share", "voltage_v", "words"),
    [
        (0.84, 15.7, "84%"),
        (0.0, 0.0, "0%"),
        (84.0, 0.0, "84%"),
        (math.nan, 14.8, "14.8 V"),
        (-1.0, 14.8, "14.8 V"),
        (140.0, 14.8, "14.8 V"),
        (math.inf, math.inf, ""),
        (math.nan, math.nan, ""),
        (math.nan, 0.0, ""),
    ],
)
def test_only_measurements_are_reported(share: float, voltage_v: float, words: str) -> None:
    battery = Battery.reported(share, voltage_v)
    assert (battery.text if battery else "") == words


def test_a_low_charge_is_detected() -> None:
    assert Battery(0.24).is_low
    assert not Battery(0.25).is_low
    assert not Battery(None, 9.0).is_low


def test_the_change_of_charge_is_text() -> None:
    assert course_of(Battery(0.84), Battery(0.71)) == "84% to 71%"
    assert course_of(Battery(0.841), Battery(0.839)) == "84%"
    assert course_of(None, Battery(0.71)) == "71%"
    assert course_of(None, None) == ""
