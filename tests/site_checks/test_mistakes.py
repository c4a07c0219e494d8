"""Each common mistake in a survey gets the message that mistakes.md shows."""

from pathlib import Path

import pytest

from scripts.mistakes_page import PREAMBLE, row
from tests.site_checks.mistakes import FLAT, MISTAKES, RADIUS_M, Mistake
from vsnbench.site_checks.check import check_site_file

PAGE = (Path(__file__).with_name("mistakes.md")).read_text(encoding="utf-8")
"""Made by `make docs`."""


def test_the_flat_without_mistakes_has_no_findings() -> None:
    assert check_site_file(FLAT, RADIUS_M)[1] == []


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake.what)
def test_a_mistake_gets_the_message_in_the_docs(mistake: Mistake, tmp_path: Path) -> None:
    assert row(mistake, tmp_path) in PAGE


def test_the_docs_have_no_other_mistakes() -> None:
    assert PAGE.startswith(PREAMBLE)
    assert len(PAGE.removeprefix(PREAMBLE).splitlines()) == len(MISTAKES)


def test_there_are_at_least_thirty_mistakes() -> None:
    assert len({mistake.what for mistake in MISTAKES}) >= 30
