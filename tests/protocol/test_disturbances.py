import pytest

from vsnbench.errors import UsageError
from vsnbench.protocol.disturbances import (
    KINDS,
    NONE,
    SEVERITIES,
    STANDARD_SET,
    Disturbance,
    Disturbances,
    parse_disturbances,
    text_of_conditions,
)
from vsnbench.values.observation import Sensor


def test_a_value_a_severity_and_a_bare_name_are_read() -> None:
    chosen = parse_disturbances(["low_light@4,blur=2.5px", "camera-height=-0.1m"])
    assert [(member.name, member.value) for member in chosen.members] == [
        ("blur", 2.5),
        ("low_light", 0.93),
        ("camera_height", -0.1),
    ]
    assert parse_disturbances(["glare"]) == parse_disturbances(["glare@3"])
    assert parse_disturbances([]) == NONE


def test_equal_values_are_one_condition_however_they_are_written() -> None:
    written = (parse_disturbances([text]) for text in ("blur@3,glare@1", "glare=0.2,blur=4", "glare=2e-1,blur=4.0 px"))
    assert len({str(chosen.conditions) for chosen in written}) == 1


def test_without_disturbances_there_is_no_condition() -> None:
    assert NONE.conditions == {}
    assert NONE.text == ""
    assert not NONE


@pytest.mark.parametrize(
    ("text", "code", "part"),
    [
        ("blurr", "unknown-disturbance", "did you mean blur?"),
        ("fog=2", "unknown-disturbance", "give blur, glare"),
        ("latency=300ms", "invalid-disturbance", "latency is in s, not ms"),
        ("blur=2deg", "invalid-disturbance", "blur is in px, not deg"),
        ("blur@9", "invalid-severity", "severities are 1 to 5"),
        ("blur@", "invalid-severity", "severities are 1 to 5"),
        ("blur@nan", "invalid-severity", "severities are 1 to 5"),
        ("blur=nan", "invalid-disturbance", "not a finite number"),
        ("blur=inf", "invalid-disturbance", "not a finite number"),
        ("blur=1e999", "invalid-disturbance", "out of range"),
        ("blur=", "invalid-disturbance", "not a finite number"),
        ("blur=-1", "invalid-disturbance", "out of range"),
        ("camera_tilt=0", "invalid-disturbance", "not 0"),
        ("camera_tilt=80", "invalid-disturbance", "-45 to 45 deg"),
        ("dropped_frames=1", "invalid-disturbance", "out of range"),
        ("stale_frames=1.5", "invalid-disturbance", "whole number"),
        ("blur,blur", "duplicate-disturbance", "given twice"),
        ("blur=2,blur@4", "duplicate-disturbance", "given twice"),
        ("", "invalid-disturbance", "cannot read"),
        ("blur,,glare", "invalid-disturbance", "cannot read"),
        ("=2", "invalid-disturbance", "cannot read"),
    ],
)
def test_invalid_disturbances_are_refused_in_one_line(text: str, code: str, part: str) -> None:
    with pytest.raises(UsageError) as refused:
        parse_disturbances([text])
    assert refused.value.code == code
    assert part in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", KINDS)
def test_severities_grow_within_the_range_of_a_kind(name: str) -> None:
    kind = KINDS[name]
    sizes = [abs(value) for value in kind.values]
    assert sizes == sorted(set(sizes))
    assert all(kind.lowest <= value <= kind.highest for value in kind.values)
    for severity in SEVERITIES:
        member = kind.at(severity)
        assert member.severity == severity
        assert (
            parse_disturbances([member.text]) == parse_disturbances([f"{name}@{severity}"]) == Disturbances((member,))
        )
    assert Disturbance(name, kind.values[0] * 1.01).severity is None


def test_the_standard_set_has_every_kind_that_changes_a_sensor_at_once() -> None:
    assert len(STANDARD_SET) == 8
    assert set(KINDS) - set(STANDARD_SET) == {"latency", "stale_frames"}


def test_recorded_conditions_are_shown_as_typed_even_from_other_versions() -> None:
    chosen = parse_disturbances(["glare@1,blur=2"])
    assert text_of_conditions(chosen.conditions) == chosen.text == "blur=2,glare=0.2"
    assert text_of_conditions({"disturbances": {"zoom": 3, "blur": 2.0}}) == "blur=2,zoom=3"
    assert text_of_conditions({"disturbances": {"zoom": None}}) == "zoom=None"
    assert text_of_conditions({"simulator": "7"}) == text_of_conditions({"disturbances": "blur"}) == ""


def test_disturbances_of_sensors_that_a_model_lacks_are_named() -> None:
    chosen = parse_disturbances(["blur,depth_holes,camera_tilt,latency"])
    assert chosen.unused_by(frozenset({Sensor.RGB, Sensor.ODOMETRY})) == ("depth_holes",)
    assert chosen.unused_by(frozenset({Sensor.DEPTH})) == ("blur",)
