"""Mistakes in a site file get one-line errors: wrong unit, decimal comma, missing field, misspelt category."""

import re
from pathlib import Path

import pytest

from vsnbench.sites.length_unit import check_rooms
from vsnbench.sites.site import embedded_sites, load_site, site_file_faults


def apartment() -> str:
    return embedded_sites()["apartment"].read_text(encoding="utf-8")


def problems(tmp_path: Path, text: str) -> list[str]:
    path = tmp_path / "flat.yaml"
    path.write_text(text, encoding="utf-8")
    return [fault.problem for fault in site_file_faults(path)]


@pytest.mark.parametrize(("times", "unit"), [(100, "centimetres"), (1000, "millimetres")])
def test_another_unit_is_one_line_that_names_the_room(tmp_path: Path, times: int, unit: str) -> None:
    text = re.sub(r"(?<![\w.])\d+\.\d+(?![\w.])", lambda found: f"{float(found[0]) * times:g}", apartment())
    (problem,) = problems(tmp_path, text)
    assert f"this looks like {unit}" in problem
    assert problem.startswith(f"room {load_site('apartment').rooms[0].name} reaches to ")


@pytest.mark.parametrize("content", [None, [], {"rooms": 3}, {"rooms": [None, {"polygon": "x"}]}])
def test_content_that_is_not_a_site_passes_unchanged(content: object) -> None:
    assert check_rooms(content) == content


def test_all_mistakes_are_reported_together(tmp_path: Path) -> None:
    text = apartment().replace("category: chair,", "category: chairs,", 1)
    text = re.sub(r"heading_deg: -?\d+(?=, size_m)", "heading_deg: '1,5'", text, count=1)
    assert problems(tmp_path, text) == [
        "expected a number, got '1,5': write 1.5, with a point",
    ]
    number = re.search(r"number: 1,.*", apartment())
    assert number is not None
    left_out = apartment().replace(number[0], re.sub(r", heading_deg: -?[\d.]+", "", number[0]))
    assert problems(tmp_path, left_out) == ["required field is missing"]
    commas = re.sub(r"position: \[(\d+)\.(\d+), (\d+)\.(\d+)\]", r"position: [\1,\2, \3,\4]", apartment(), count=1)
    assert problems(tmp_path, commas) == ["expected 2 values, got 4: is this a decimal comma? Write 1.5, not 1,5"]
