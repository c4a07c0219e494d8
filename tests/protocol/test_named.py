"""Named protocols and protocol files."""

from pathlib import Path

import pytest

from vsnbench.errors import ProtocolError
from vsnbench.protocol.named import NAMED, load_protocol, parameter_rows, protocol_file_faults
from vsnbench.protocol.parameters import ProtocolParameters


def written(directory: Path, text: str) -> str:
    path = directory / "lab.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_the_default_is_the_paper_s_protocol() -> None:
    assert load_protocol("ros4vsn") == ProtocolParameters()
    assert next(iter(NAMED)) == "ros4vsn"


def test_the_values_of_named_protocols_never_change() -> None:
    habitat, onsite, goat = (
        load_protocol(name) for name in ("habitat-objectnav", "onsite-instruction", "goat-sequence")
    )
    assert (habitat.max_actions, habitat.forward_m, habitat.turn_deg, habitat.success_distance_m) == (500, 0.25, 30, 1)
    assert (habitat.max_time_s, habitat.max_path_m) == (None, None)
    assert (onsite.max_time_s, onsite.success_distance_m, onsite.in_sight, onsite.max_actions) == (360, 2, True, 1000)
    assert (onsite.forward_m, onsite.turn_deg) == (0.2, 15)
    assert (goat.max_actions, goat.forward_m, goat.turn_deg, goat.success_distance_m) == (500, 0.25, 30, 1)
    assert [each.parameters.name for each in NAMED.values()] == list(NAMED)


def test_a_file_has_the_paper_s_values_where_it_gives_none(tmp_path: Path) -> None:
    path = written(tmp_path, "name: lab\nmax_time_s: 60\n")
    assert load_protocol(path) == ProtocolParameters(name="lab", max_time_s=60)
    assert protocol_file_faults(path) == []


def test_a_file_with_a_built_in_protocol_is_that_protocol(tmp_path: Path) -> None:
    assert load_protocol(written(tmp_path, "name: ros4vsn\n")) == ProtocolParameters()


@pytest.mark.parametrize(
    ("text", "faults"),
    [
        ("name: lab\nmax_tim_s: 5\nmax_path_m: -1\n", [(2, "unknown-field"), (3, "invalid-field")]),
        ("name: lab\n\nmax_actions: 0\nturn_deg: .nan\n", [(3, "invalid-field"), (4, "invalid-field")]),
        ("max_actions: 5\n", [(1, "missing-field")]),
        ("name: ros4vsn\nmax_actions: 5\n", [(1, "invalid-field")]),
        ("name: lab\nforward_m: 0.5\n", [(1, "invalid-field")]),
        ("- 1\n", [(1, "invalid-yaml")]),
    ],
)
def test_a_check_reports_every_fault_with_its_line(tmp_path: Path, text: str, faults: list[tuple[int, str]]) -> None:
    path = written(tmp_path, text)
    assert [(fault.line or 1, fault.code) for fault in protocol_file_faults(path)] == faults
    with pytest.raises(ProtocolError) as refused:
        load_protocol(path)
    assert refused.value.code == faults[0][1]


def test_every_parameter_has_a_value_a_meaning_and_a_source() -> None:
    for each in NAMED.values():
        rows = parameter_rows(each.parameters)
        assert all(row.source and row.meaning for row in rows)
        assert {row.name.partition(".")[0] for row in rows} == set(ProtocolParameters.model_fields)
    (limit,) = (row for row in parameter_rows(load_protocol("onsite-instruction")) if row.name == "max_time_s")
    assert (limit.value, limit.unit, limit.default) == (360, "s", None)


def test_values_of_a_file_name_the_file_as_their_source() -> None:
    rows = {row.name: row.source for row in parameter_rows(ProtocolParameters(name="lab", max_path_m=9), "lab.yaml")}
    assert rows["max_path_m"] == "lab.yaml"
    assert rows["max_actions"] != "lab.yaml"
