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


@pytest.mark.parametrize(
    ("right", "slip", "told"),
    [
        ("size_m: [2.05, ", "size_m: [2050, ", "these look like millimetres; in metres it is 2.05"),
        ("size_m: [2.05, ", "size_m: [2000, ", "these look like centimetres or millimetres; in metres it is 20 or 2"),
        ("size_m: [2.05, ", "size_m: [205, ", "these look like centimetres; in metres it is 2.05"),
        (
            "position: [8.8, 4.32]",
            "position: '8.8, 4.32'",
            "'8.8, 4.32' is no list of coordinates: a list is written",
        ),
        ("position: [8.8, 4.32]", "position: [8.8, 4.32, 0]", "a height beside x and y? It is left out"),
        ("position: [8.8, 4.32]", "pos: [8.8, 4.32]", "there is no such field: did you mean position?"),
        ("heading_deg: 165", "heading_deg: North-West", "up 90: write 135"),
        (
            "category: rug",
            "category: round rug",
            "'round rug': write rug; `model` says of which kind",
        ),
        ("starts:", "starts:\nplaces:", "nothing stands under it"),
    ],
)
def test_slips_of_newcomers_are_told_with_what_to_write(tmp_path: Path, right: str, slip: str, told: str) -> None:
    assert right in apartment()
    faults = [f"{fault.problem} {fault.mend}" for fault in site_file_faults(place(tmp_path, right, slip))]
    assert [fault for fault in faults if told in fault], faults


def place(tmp_path: Path, right: str, slip: str) -> Path:
    """Write the apartment's file with one slip."""
    path = tmp_path / "flat.yaml"
    path.write_text(apartment().replace(right, slip, 1), encoding="utf-8")
    return path
