"""The YAML reader: right values in, or the line and the field of what is wrong."""

from enum import StrEnum
from pathlib import Path

import pytest
from pydantic import BaseModel, ConfigDict

from vsnbench.errors import SiteError
from vsnbench.protocol.settings_file import parse_settings, read_settings, settings_faults


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
            r"^cart.yaml:3: wheels.0.tyre: 'ruber' is none of its words: did you mean rubber\?$",
        ),
        ("# a remark\n\nname: a\ncolour: red\n", r"^cart.yaml:4: colour: there is no such field$"),
        ("nam: a\nwheels: []\n", r"^cart.yaml:1: nam: there is no such field: did you mean name\? \(and 1 more\)$"),
        ("name: a\nwheels: []\nname: b\n", r"^cart.yaml:3: name is given twice in the same place$"),
        (
            "name: a\nwheels:\n- {radius_m: 1, radius_m: 2}\n",
            r"^cart.yaml:3: radius_m is given twice in the same place$",
        ),
        ("name: a\nwheels: \x01\n", r"^cart.yaml:2: not valid YAML: a control character$"),
        (
            "name: a\nwheels:\n\t- {}\n",
            r"^cart.yaml:3: not valid YAML: found character '\\t' that cannot start any token$",
        ),
        ("name: a\n---\nname: b\n", r"^cart.yaml:2: not valid YAML: but found another document$"),
        ("name: 2026-99-99\n", r"^cart.yaml: not valid YAML: month must be in 1..12$"),
        ("name: 1" + "0" * 5000, r"^cart.yaml: not valid YAML: Exceeds the limit"),
        ("name: !!python/object/apply:os.system [ls]\n", r"^cart.yaml:1: not valid YAML: could not determine a constr"),
        ("name: " + "[" * 5000 + "]" * 5000, r"^cart.yaml: not valid YAML: too many levels$"),
        ("name: &a [*a]\n", r"^cart.yaml: aliases and merge keys make more than 250,000 values"),
        ("wheels: []\n", r"^cart.yaml:1: name: it is missing$"),
        ("name: a\nwheels:\n- {}\n- {}\n", r"^cart.yaml:3: wheels.0.radius_m: it is missing \(and 1 more\)$"),
        ("name: a\n  wheels: [\n", r"^cart.yaml:2: not valid YAML: "),
        ("- a\n- b\n", r"^cart.yaml:1: a cart file is a mapping with name$"),
        ("", r"^cart.yaml:1: a cart file is a mapping with name$"),
    ],
)
def test_a_broken_file_is_told_where_and_what(text: str, expected: str) -> None:
    with pytest.raises(SiteError, match=expected):
        parse(text)


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cart.yaml"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(SiteError, match=r"cannot read cart file .*: it is no text in UTF-8$"):
        read_settings(path, Cart, SiteError, "cart")


def test_a_missing_file_is_an_error_of_the_asked_class(tmp_path: Path) -> None:
    with pytest.raises(SiteError, match="cannot read cart file"):
        read_settings(tmp_path / "none.yaml", Cart, SiteError, "cart")


def merge_bomb(levels: int) -> str:
    merged = (f"a{level}: &a{level}\n  <<: [{', '.join([f'*a{level - 1}'] * 9)}]" for level in range(1, levels))
    return "\n".join(["a0: &a0 {k: 1}", *merged])


def alias_bomb(levels: int) -> str:
    lines = ["a0: &a0 [x, y]"]
    lines += [f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * 9)}]" for level in range(1, levels)]
    return "\n".join(lines)


@pytest.mark.parametrize("text", [merge_bomb(12), alias_bomb(12), "a: &a\n  <<: *a\n"])
def test_a_bomb_of_aliases_is_refused_before_it_is_built(text: str) -> None:
    with pytest.raises(SiteError, match="make more than 250,000 values"):
        parse(text)


def test_a_file_too_long_is_refused_unread() -> None:
    with pytest.raises(SiteError, match="longer than 2,000,000 characters"):
        parse("name: a\n" + "# \n" * 700_000)


def test_merge_keys_work_and_give_way_to_what_is_written_beside_them() -> None:
    text = "name: a\nwheels:\n- &wheel {radius_m: 0.2}\n- {<<: *wheel}\n- {<<: *wheel, radius_m: 0.4}\n"
    assert [wheel.radius_m for wheel in parse(text).wheels] == [0.2, 0.2, 0.4]


def test_all_faults_of_a_file_can_be_had_at_once(tmp_path: Path) -> None:
    path = tmp_path / "cart.yaml"
    path.write_text("nam: a\nwheels:\n- {}\n- {radius_m: round}\n")
    faults = [str(fault) for fault in settings_faults(path, Cart, SiteError, "cart")]
    assert len(faults) == 4
    assert faults[0] == f"{path}:1: nam: there is no such field: did you mean name?"
    assert any(fault.startswith(f"{path}:4: wheels.1.radius_m: ") for fault in faults)
    path.write_text("name: a\n")
    assert settings_faults(path, Cart, SiteError, "cart") == []
