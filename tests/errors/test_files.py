"""A faulty file of a user is refused with the code of its error and a line that names file, line and field."""

import re
from pathlib import Path
from typing import Any

import pytest

from tests.errors.loaders import LOADERS, refusal, spoil
from vsnbench.settings.yaml_text import load_yaml

TABLE = load_yaml((Path(__file__).parent / "files.yaml").read_text(encoding="utf-8"))
ROWS = [(name, *row) for name, rows in TABLE.items() for row in rows]
WORDS_OF_PYDANTIC = re.compile(r"Input|String should|valid (number|string|list|tuple|dict|bool|integer)|unable to|: \^")


@pytest.mark.parametrize("name", LOADERS)
def test_the_good_file_of_a_loader_is_read(name: str, tmp_path: Path) -> None:
    assert refusal(LOADERS[name], spoil(LOADERS[name], LOADERS[name].good, tmp_path)) == ("", "", [])


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]}: {row[1]}"[:60])
def test_a_fault_has_its_code_and_its_words(row: Any, tmp_path: Path) -> None:
    name, wrong, code, *words = row
    loader = LOADERS[name]
    if name == "goal":
        wrong = f"{loader.good}\ngoals:\n  {wrong}\n"
    path = spoil(loader, wrong, tmp_path)
    found, line, faults = refusal(loader, path)
    assert found == code, line
    assert line.count("\n") == 0
    assert [each for each in (line, *faults) if all(word in each for word in words)], (line, *faults)
    assert not [each for each in (line, *faults) if WORDS_OF_PYDANTIC.search(each)]
    if name == "apartment" and isinstance(wrong, list) and "\n" not in wrong[1] and "repeated" not in line:
        assert f"{path}:{first_changed_line(loader.good, path)}: " in line


def first_changed_line(good: str, path: Path) -> int:
    """Return the number of the first line that is not that of the good file, from 1."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return next(
        number for number, pair in enumerate(zip(good.splitlines(), lines, strict=False), 1) if len(set(pair)) > 1
    )
