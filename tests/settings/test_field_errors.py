"""An invalid field in a settings file gets a statement and a fix in the units of the field."""

import re
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.settings.validation import SettingsFault
from vsnbench.settings.yaml_file import text_faults
from vsnbench.settings.yaml_text import dump_yaml, load_yaml
from vsnbench.sites.site import Site
from vsnbench.values.robot_profile import RobotProfile

FLAT = Path(__file__).parents[1] / "site_checks" / "flat.yaml"
TURTLEBOT = Path(__file__).parents[2] / "vsnbench" / "robots" / "profiles" / "turtlebot2.yaml"
OF_PYDANTIC = re.compile(r"Input|String should|valid (number|string|list|tuple|dict|bool|integer)|unable to|^\^")
NAN, INFINITE = float("nan"), float("inf")


def faults(text: str, model: type[BaseModel], field: str, value: Any) -> list[SettingsFault]:
    """Return the faults of a file in which one field has another value."""
    content = here = load_yaml(text)
    *parents, last = [int(part) if part.isdecimal() else part for part in field.split(".")]
    for part in parents:
        here = here[part] if isinstance(here, list) else here.setdefault(part, {})
    here[last] = value
    return text_faults(dump_yaml(content), "f.yaml", model, "flat")


def assert_reported(found: list[SettingsFault], field: str, statement: str, advice: str) -> None:
    assert not any(OF_PYDANTIC.search(str(fault)) or "\n" in str(fault) for fault in found)
    assert any(
        ".".join(map(str, fault.path)).startswith(field) and statement in fault.statement and advice in fault.advice
        for fault in found
    ), found


@pytest.mark.parametrize(
    ("field", "value", "statement", "advice"),
    [
        ("objects.0.size_m.0", -0.9, "at least 0.001 m, got -0.9 m", "depth along its heading"),
        ("objects.0.size_m.1", NAN, "got .nan", "metres"),
        ("objects.0.size_m.1", "wide", "a number, got 'wide'", "metres"),
        ("objects.0.size_m", [0.5, 0.5], "expected 3 values, got 2", "depth along its heading, width across it"),
        ("objects.0.size_m", 0.5, "a list, got 0.5", "3 values"),
        ("objects.0.position.1", None, "a number, got nothing", "metres"),
        ("objects.0.position", {"x": 1, "y": 2}, "a list, got a mapping", "2 values"),
        ("objects.0.heading_deg", -INFINITE, "got -.inf", "degrees"),
        ("objects.0.solid", "nope", "true or false, got 'nope'", ""),
        ("objects.0", "chair", "a mapping, got 'chair'", "id, category, position, size_m"),
        ("objects.0.id", "Über", "'Über'", "write uber"),
        ("objects.0.category", ["chair"], "text, got a list", '"chair"'),
        ("starts.0.note", load_yaml("2026-01-02"), "text, got 2026-01-02", '"2026-01-02"'),
        ("starts.0.number", 1.5, "a whole number, got 1.5", ""),
        ("starts.0.not_for", "chair", "a list, got 'chair'", "[chair]"),
        ("rooms.0.floor", "tile", "'tile'", "did you mean tiles?"),
        ("rooms.0.floor_color", "brown", "'brown' is not a colour", '"#a05a2c"'),
        ("rooms.0.floor_color", 12345, "12345 is not a colour", '"#012345"'),
        ("walls.0.thickness_m", 0, "above 0.01 m, got 0 m", ""),
        ("ceiling_height_m", True, "a number, got true", "metres"),
        ("survey_error_m", 0.3, "at most 0.2 m, got 0.3 m", "standard deviation"),
        ("survey_error_m", 2, "at most 0.2 m, got 2 m", "centimetres; in metres it is 0.02"),
    ],
)
def test_an_invalid_field_of_a_site(field: str, value: Any, statement: str, advice: str) -> None:
    assert_reported(faults(FLAT.read_text(), Site, field, value), field, statement, advice)


def test_an_error_names_the_object_around_the_field() -> None:
    (fault,) = faults(FLAT.read_text(), Site, "objects.0.solid", "nope")
    assert fault.where.endswith(": objects.0.solid (sofa-1)")
    assert faults(FLAT.read_text(), Site, "title", "") == []


@pytest.mark.parametrize(
    ("field", "value", "statement", "advice"),
    [
        ("base.radius_m", -0.2, "above 0.05 m, got -0.2 m", ""),
        ("base.radius_m", 17.7, "got 17.7 m", "centimetres; in metres it is 0.177"),
        ("base.radius_m", NAN, "got .nan", ""),
        ("base.max_angular_rad_s", 180, "got 180 rad/s", ""),
        ("speeds.linear_m_s", 30, "below 3 m/s, got 30 m/s", "centimetres; in metres per second it is 0.3"),
        ("camera.width", "VGA", "a whole number, got 'VGA'", "image width, pixels"),
        ("camera.mount_forward_m", NAN, "got .nan", ""),
        ("camera.depth_max_m", INFINITE, "got .inf", ""),
        ("camera", "astra", "a mapping, got 'astra'", "width, height, horizontal_fov_deg"),
    ],
)
def test_an_invalid_field_of_a_robot_profile(field: str, value: Any, statement: str, advice: str) -> None:
    assert_reported(faults(TURTLEBOT.read_text(), RobotProfile, field, value), field, statement, advice)


@pytest.mark.parametrize(
    ("field", "value", "statement", "advice"),
    [
        ("max_actions", 0, "at least 1, got 0", "an episode ends at this action"),
        ("max_actions", "many", "a whole number, got 'many'", "an episode ends at this action"),
        ("success_distance_m", 100, "got 100 m", "centimetres; in metres it is 1"),
        ("turn_deg", 360, "at most 180°, got 360°", "angle of TURN_LEFT and TURN_RIGHT"),
        ("version", 4, "4 is not allowed", "1, 2 or 3"),
        ("depth_guard.enabled", "sometimes", "true or false, got 'sometimes'", ""),
        ("placement", 5, "a mapping, got 5", "distance_m, heading_deg"),
    ],
)
def test_an_invalid_field_of_the_protocol(field: str, value: Any, statement: str, advice: str) -> None:
    assert_reported(faults("max_actions: 150", ProtocolParameters, field, value), field, statement, advice)
