"""What people get wrong in a survey, each with the message that it gets."""

from pathlib import Path

import pytest

from scripts.mistakes_page import PREAMBLE, row
from tests.protocol.survey.mistakes import FLAT, MISTAKES, RADIUS_M, Mistake
from vsnbench.protocol.survey.check import check_site_file

PAGE = (Path(__file__).parents[3] / "docs" / "survey-mistakes.md").read_text(encoding="utf-8")
"""Made by `make docs`."""


def test_the_flat_that_mistakes_are_made_on_is_sound() -> None:
    assert check_site_file(FLAT, RADIUS_M)[1] == []


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake.what)
def test_a_mistake_is_named_with_its_place_and_its_mend_as_the_docs_say(mistake: Mistake, tmp_path: Path) -> None:
    assert row(mistake, tmp_path) in PAGE


def test_the_docs_have_no_mistake_that_is_not_tried() -> None:
    assert PAGE.startswith(PREAMBLE)
    assert len(PAGE.removeprefix(PREAMBLE).splitlines()) == len(MISTAKES)


def test_at_least_thirty_mistakes_are_tried() -> None:
    assert len({mistake.what for mistake in MISTAKES}) >= 30
