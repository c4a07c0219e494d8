"""An invalid field in a settings file gets a statement and a fix in the units of the field."""

from pathlib import Path
from typing import Any

from pydantic import BaseModel

from vsnbench.settings.validation import SettingsFault
from vsnbench.settings.yaml_file import text_faults
from vsnbench.settings.yaml_text import dump_yaml, load_yaml
from vsnbench.sites.site import Site

FLAT = Path(__file__).parents[1] / "site_checks" / "flat.yaml"
NAN, INFINITE = float("nan"), float("inf")


def faults(text: str, model: type[BaseModel], field: str, value: Any) -> list[SettingsFault]:
    """Return the faults of a file in which one field has another value."""
    content = here = load_yaml(text)
    *parents, last = [int(part) if part.isdecimal() else part for part in field.split(".")]
    for part in parents:
        here = here[part] if isinstance(here, list) else here.setdefault(part, {})
    here[last] = value
    return text_faults(dump_yaml(content), "f.yaml", model, "flat")


def test_an_error_names_the_object_around_the_field() -> None:
    (fault,) = faults(FLAT.read_text(), Site, "objects.0.solid", "nope")
    assert fault.where.endswith(": objects.0.solid (sofa-1)")
    assert faults(FLAT.read_text(), Site, "title", "") == []
