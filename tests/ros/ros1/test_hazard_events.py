"""The state of a Kobuki as events of its hazard sensors."""

import pytest

from vsnbench.ros.ros1.hazard_events import KobukiStates
from vsnbench.ros.ros1.messages import SensorState
from vsnbench.sensing.hazards import Hazard

pytestmark = pytest.mark.ros


def test_the_bits_of_a_state_are_the_sensors_of_the_events() -> None:
    taken: list = []
    states = KobukiStates(lambda *event: taken.append(event))
    states(SensorState())
    assert taken == []
    states(SensorState(bumper=4, cliff=1, wheel_drop=2))
    assert taken == [
        (Hazard.BUMPER, 0, True, "left"),
        (Hazard.CLIFF, 2, True, "right"),
        (Hazard.WHEEL_DROP, 0, True, "left"),
    ]


def test_only_changes_of_a_state_are_events() -> None:
    taken: list = []
    states = KobukiStates(lambda *event: taken.append(event))
    for bits in (2, 2, 3, 1, 0):
        states(SensorState(bumper=bits))
    assert taken == [
        (Hazard.BUMPER, 1, True, "centre"),
        (Hazard.BUMPER, 2, True, "right"),
        (Hazard.BUMPER, 1, False, "centre"),
        (Hazard.BUMPER, 2, False, "right"),
    ]
