"""A surveyor's slips, each told in one line: another unit, a decimal comma, a field left out, a category misspelt."""

import re
from pathlib import Path

import pytest

from vsnbench.protocol.length_unit import in_metres
from vsnbench.protocol.site import embedded_sites, load_site, site_file_faults


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
    assert f"these look like {unit}" in problem
    assert problem.startswith(f"room {load_site('apartment').rooms[0].name} reaches to ")


@pytest.mark.parametrize("content", [None, [], {"rooms": 3}, {"rooms": [None, {"polygon": "x"}]}])
def test_what_is_no_site_is_left_to_the_format(content: object) -> None:
    assert in_metres(content) == content


def test_slips_are_told_at_once_in_words_of_ours(tmp_path: Path) -> None:
    text = apartment().replace("category: chair,", "category: chairs,", 1)
    text = re.sub(r"heading_deg: -?\d+(?=, size_m)", "heading_deg: '1,5'", text, count=1)
    assert problems(tmp_path, text) == [
        "1,5 is no number: write 1.5, with a point",
        "the unknown category 'chairs': did you mean chair?",
    ]
    number = re.search(r"number: 1,.*", apartment())
    assert number is not None
    left_out = apartment().replace(number[0], re.sub(r", heading_deg: -?[\d.]+", "", number[0]))
    assert problems(tmp_path, left_out) == ["it is missing"]
    commas = re.sub(r"position: \[(\d+)\.(\d+), (\d+)\.(\d+)\]", r"position: [\1,\2, \3,\4]", apartment(), count=1)
    assert problems(tmp_path, commas) == [
        "4 values in place of 2: a decimal comma? 1.5 is written with a point: [0.38, 7.12]"
    ]
