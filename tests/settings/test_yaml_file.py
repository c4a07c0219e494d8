"""The YAML reader returns the model, or an error with line, field and code."""

import os
import time
from enum import StrEnum
from pathlib import Path

import pytest
from pydantic import BaseModel, ConfigDict

from vsnbench.errors import SiteError
from vsnbench.settings.validation import MOST_FAULTS
from vsnbench.settings.yaml_file import parse_settings, read_settings, settings_faults


class Tyre(StrEnum):
    RUBBER = "rubber"
    FOAM = "foam"


class Wheel(BaseModel):
    model_config = ConfigDict(extra="forbid")
    radius_m: float
    tyre: Tyre = Tyre.RUBBER


class Cart(BaseModel):
    model_config = ConfigDict(extra="forbid")
    name: str
    wheels: list[Wheel] = []


def parse(text: str) -> Cart:
    return parse_settings(text, "cart.yaml", Cart, SiteError, "cart")


def test_a_good_file_becomes_its_model(tmp_path: Path) -> None:
    path = tmp_path / "cart.yaml"
    path.write_text("name: wagon\nwheels:\n- radius_m: 0.2\n- {radius_m: 0.3}\n")
    cart = read_settings(path, Cart, SiteError, "cart")
    assert [wheel.radius_m for wheel in cart.wheels] == [0.2, 0.3]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("name: a\nwheels:\n- radius_m: 0.2\n- radius_m: round\n", r"^cart.yaml:4: wheels.1.radius_m: "),
        (
            "name: a\nwheels:\n- {radius_m: 1, tyre: ruber}\n",
            r"^cart.yaml:3: wheels.0.tyre: 'ruber' is not allowed: did you mean rubber\?$",
        ),
        ("# a remark\n\nname: a\ncolour: red\n", r"^cart.yaml:4: colour: unknown field$"),
        ("nam: a\nwheels: []\n", r"^cart.yaml:1: nam: unknown field: did you mean name\? \(and 1 more\)$"),
        ("name: a\nwheels: []\nname: b\n", r"^cart.yaml:3: field name is repeated$"),
        (
            "name: a\nwheels:\n- {radius_m: 1, radius_m: 2}\n",
            r"^cart.yaml:3: field radius_m is repeated$",
        ),
        ("name: a\nwheels: \x01\n", r"^cart.yaml:2: not valid YAML: a control character$"),
        (
            "name: a\nwheels:\n\t- {}\n",
            r"^cart.yaml:3: not valid YAML: found character '\\t' that cannot start any token$",
        ),
        ("name: a\n---\nname: b\n", r"^cart.yaml:2: not valid YAML: but found another document$"),
        ("name: 2026-99-99\n", r"^cart.yaml: not valid YAML: month must be in 1..12$"),
        ("name: 1" + "0" * 5000, r"^cart.yaml:1: a number has 5001 digits$"),
        ("name: a\nwheels:\n- {radius_m: " + "9" * 400 + "}\n", r"^cart.yaml:3: a number has 400 digits$"),
        ("name: a\nwheels:\n- {radius_m: -" + "9" * 400 + "}\n", r"^cart.yaml:3: a number has 401 digits$"),
        ("name: !!python/object/apply:os.system [ls]\n", r"^cart.yaml:1: not valid YAML: could not determine a constr"),
        ("name: " + "[" * 1500 + "]" * 1500, r"^cart.yaml: not valid YAML: too many levels$"),
        ("name: &a [*a]\n", r"^cart.yaml: aliases and merge keys expand to more than 250,000 values"),
        ("wheels: []\n", r"^cart.yaml:1: name: required field is missing$"),
        (
            "name: a\nwheels:\n- {}\n- {}\n",
            r"^cart.yaml:3: wheels.0.radius_m: required field is missing \(and 1 more\)$",
        ),
        ("name: a\n  wheels: [\n", r"^cart.yaml:2: not valid YAML: "),
        ("- a\n- b\n", r"^cart.yaml:1: a cart file must be a mapping with name$"),
        ("", r"^cart.yaml:1: a cart file must be a mapping with name$"),
    ],
)
def test_an_invalid_file_is_reported_with_line_and_field(text: str, expected: str) -> None:
    with pytest.raises(SiteError, match=expected):
        parse(text)


def test_a_binary_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cart.yaml"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(SiteError, match=r"cannot read cart file .*: it is not UTF-8 text$"):
        read_settings(path, Cart, SiteError, "cart")


def test_a_missing_file_is_an_error_of_the_given_class(tmp_path: Path) -> None:
    with pytest.raises(SiteError, match="cannot read cart file") as refused:
        read_settings(tmp_path / "none.yaml", Cart, SiteError, "cart")
    assert refused.value.code == "unreadable-file"


def merge_bomb(levels: int) -> str:
    merged = (f"a{level}: &a{level}\n  <<: [{', '.join([f'*a{level - 1}'] * 9)}]" for level in range(1, levels))
    return "\n".join(["a0: &a0 {k: 1}", *merged])


def alias_bomb(levels: int) -> str:
    lines = ["a0: &a0 [x, y]"]
    lines += [f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * 9)}]" for level in range(1, levels)]
    return "\n".join(lines)


@pytest.mark.parametrize("text", [merge_bomb(12), alias_bomb(12), "a: &a\n  <<: *a\n"])
def test_an_alias_bomb_is_refused_before_expansion(text: str) -> None:
    with pytest.raises(SiteError, match="expand to more than 250,000 values"):
        parse(text)


def test_a_file_that_is_too_long_is_refused() -> None:
    with pytest.raises(SiteError, match="longer than 2,000,000 characters"):
        parse("name: a\n" + "# \n" * 700_000)


def test_explicit_fields_override_merge_keys() -> None:
    text = "name: a\nwheels:\n- &wheel {radius_m: 0.2}\n- {<<: *wheel}\n- {<<: *wheel, radius_m: 0.4}\n"
    assert [wheel.radius_m for wheel in parse(text).wheels] == [0.2, 0.2, 0.4]


def test_all_faults_of_a_file_are_reported_together(tmp_path: Path) -> None:
    path = tmp_path / "cart.yaml"
    path.write_text("nam: a\nwheels:\n- {}\n- {radius_m: round}\n")
    faults = [str(fault) for fault in settings_faults(path, Cart, SiteError, "cart")]
    assert len(faults) == 4
    assert faults[0] == f"{path}:1: nam: unknown field: did you mean name?"
    assert any(fault.startswith(f"{path}:4: wheels.1.radius_m: ") for fault in faults)
    path.write_text("name: a\n")
    assert settings_faults(path, Cart, SiteError, "cart") == []


@pytest.mark.parametrize("text", ["name: [" + "1," * 100_000 + "1]\n", "- \n" * 60_000, "a: \n" * 60_000])
def test_a_file_with_too_many_values_is_refused_before_it_is_parsed(text: str) -> None:
    with pytest.raises(SiteError, match="more than 100,000 lines, fields and entries of lists"):
        parse(text)


def test_the_errors_of_many_unknown_fields_are_counted_and_the_first_described(tmp_path: Path) -> None:
    path = tmp_path / "cart.yaml"
    path.write_text("name: a\n" + "".join(f"nam{number}: 1\n" for number in range(5_000)))
    began_s = time.process_time()
    with pytest.raises(SiteError, match=r"^.*:2: nam0: unknown field: did you mean name\? \(and 4999 more\)$"):
        read_settings(path, Cart, SiteError, "cart")
    faults = settings_faults(path, Cart, SiteError, "cart")
    # Describing each of the errors takes a hundred times as long as reading the file.
    assert time.process_time() - began_s < 5
    assert len(faults) == MOST_FAULTS + 1
    assert str(faults[-1]) == f"{path}: 4,900 more errors"


def test_many_numbers_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "cart.yaml"
    path.write_text("name: a\nwheels:\n" + "- {radius_m: .nan}\n" * 1000)
    assert len(settings_faults(path, Cart, SiteError, "cart")) <= MOST_FAULTS + 1


def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "cart.yaml")
    with pytest.raises(SiteError) as refused:
        read_settings(tmp_path / "cart.yaml", Cart, SiteError, "cart")
    assert refused.value.code == "unreadable-file"


def test_a_comma_in_an_unquoted_text_is_answered_with_quotation_marks(tmp_path: Path) -> None:
    path = tmp_path / "cart.yaml"
    path.write_text("{ name: by the window, near the door }")
    (fault,) = settings_faults(path, Cart, SiteError, "cart")
    assert fault.code == "unknown-field"
    assert "quotation marks" in fault.advice
