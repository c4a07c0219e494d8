"""What a slip in a settings file is told: which thing it is in, what is written there, what is wanted; in our words."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.settings_file import text_faults
from vsnbench.protocol.site import Site

FLAT = Path(__file__).with_name("survey") / "flat.yaml"
TURTLEBOT = Path(__file__).parents[2] / "vsnbench" / "robots" / "profiles" / "turtlebot2.yaml"
NOT_OURS = re.compile(r"Input|String should|valid (number|string|list|tuple|dict|bool|integer)|unable to|^\^")
NAN, INFINITE = float("nan"), float("inf")


def told(text: str, model: type, field: str, value: Any) -> list[str]:
    """Return what is said of a file in which one field has another value."""
    content = here = yaml.safe_load(text)
    *way, last = [int(part) if part.isdecimal() else part for part in field.split(".")]
    for part in way:
        here = here[part] if isinstance(here, list) else here.setdefault(part, {})
    here[last] = value
    return [str(fault) for fault in text_faults(yaml.safe_dump(content, sort_keys=False), "f.yaml", model, "flat")]


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        ("objects.0.size_m.0", -0.9, "objects.0.size_m.0 (sofa-1): -0.9 m is too small (0.001 m at least)"),
        ("objects.0.size_m.1", NAN, "objects.0.size_m.1 (sofa-1): .nan is no number: write one, in metres"),
        ("objects.0.size_m.1", "wide", "objects.0.size_m.1 (sofa-1): 'wide' is no number: write one, in metres"),
        ("objects.0.size_m", [0.5, 0.5], "(sofa-1): 2 values in place of 3: depth along its heading, width across it,"),
        ("objects.0.size_m", 0.5, "objects.0.size_m (sofa-1): 0.5 is no list: 3 values belong there, in brackets"),
        ("objects.0.position.1", None, "position.1 (sofa-1): nothing stands where a number belongs: write one, in m"),
        ("objects.0.position", {"x": 1, "y": 2}, "(sofa-1): a mapping stands where a list belongs"),
        ("objects.0.heading_deg", -INFINITE, "heading_deg (sofa-1): -.inf is no number: write one, in degrees"),
        ("objects.0.solid", "nope", "objects.0.solid (sofa-1): 'nope' is neither true nor false"),
        ("objects.0", "chair", "'chair' stands where a mapping belongs: it has id, category, position, size_m"),
        ("objects.0.id", "Über", "objects.0.id: 'Über' has other than lower-case letters, digits, - and _: write uber"),
        ("objects.0.category", ["chair"], 'category (sofa-1): a list where text belongs: in quotes, "chair"'),
        ("starts.0.note", yaml.safe_load("2026-01-02"), '(number 1): 2026-01-02 is no text: in quotes it is, "2026-'),
        ("starts.0.number", 1.5, "starts.0.number: 1.5 is no whole number"),
        ("starts.0.not_for", "chair", "(number 1): 'chair' is no list: in brackets it is one, [chair]"),
        ("rooms.0.floor", "tile", "rooms.0.floor (hall): 'tile' is none of its words: did you mean tiles?"),
        ("rooms.0.floor_color", "brown", "(hall): 'brown' is no colour: one is \"#a05a2c\", in quotes"),
        ("rooms.0.floor_color", 12345, '(hall): 12345 is no colour: write "#012345", in quotes'),
        ("walls.0.thickness_m", 0, "walls.0.thickness_m: 0 m is too small (above 0.01 m)"),
        ("ceiling_height_m", True, "ceiling_height_m: true is no number: write one, in metres"),
        ("survey_error_m", 0.3, "survey_error_m: 0.3 m is more than 0.2 m: standard deviation of walls; objects twice"),
        ("survey_error_m", 2, "2 m is more than 0.2 m: these look like centimetres; in metres it is 0.02"),
        ("title", "", ""),
    ],
)  # fmt: skip
def test_a_slip_in_a_site_names_its_thing_what_is_written_and_what_is_wanted(
    field: str, value: Any, expected: str
) -> None:
    faults = told(FLAT.read_text(), Site, field, value)
    assert any(expected in fault for fault in faults) if expected else faults == [], faults
    assert not any(NOT_OURS.search(fault) or "\n" in fault for fault in faults)


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        ("base.radius_m", -0.2, "base.radius_m: -0.2 m is too small (above 0.05 m): without the minus it is 0.2"),
        ("base.radius_m", 17.7, "17.7 m is more than 1 m: these look like centimetres; in metres it is 0.177"),
        ("base.radius_m", NAN, "base.radius_m: .nan is no number"),
        ("base.max_angular_rad_s", 180, "these look like degrees a second; in radians it is 3.14"),
        ("speeds.linear_m_s", 30, "30 m/s is more than 3 m/s: these look like centimetres; in metres a second"),
        ("camera.width", "VGA", "camera.width: 'VGA' is no whole number: image width, pixels"),
        ("camera.mount_forward_m", NAN, "camera.mount_forward_m: .nan is no number"),
        ("camera.depth_max_m", INFINITE, "camera.depth_max_m: .inf is no number"),
        ("camera", "astra", "'astra' stands where a mapping belongs: it has width, height, horizontal_fov_deg, mount_"),
    ],
)  # fmt: skip
def test_a_slip_in_a_robot_profile_is_told_in_the_units_of_its_field(field: str, value: Any, expected: str) -> None:
    faults = told(TURTLEBOT.read_text(), RobotProfile, field, value)
    assert any(expected in fault for fault in faults), faults
    assert not any(NOT_OURS.search(fault) for fault in faults)


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        ("max_actions", 0, "max_actions: 0 is too small (1 at least): an episode ends at this action"),
        ("max_actions", "many", "max_actions: 'many' is no whole number: an episode ends at this action"),
        ("success_distance_m", 100, "these look like centimetres; in metres it is 1"),
        ("turn_deg", 360, "turn_deg: 360° is more than 180°: angle of TURN_LEFT and TURN_RIGHT"),
        ("version", 3, "version: 3 is none of its words: write 1 or 2"),
        ("depth_guard.enabled", "sometimes", "depth_guard.enabled: 'sometimes' is neither true nor false"),
        ("placement", 5, "placement: 5 stands where a mapping belongs: it has distance_m, heading_deg"),
    ],
)
def test_a_slip_in_the_protocol_says_what_the_number_is(field: str, value: Any, expected: str) -> None:
    faults = told("max_actions: 150", ProtocolParameters, field, value)
    assert any(expected in fault for fault in faults), faults
    assert not any(NOT_OURS.search(fault) for fault in faults)
