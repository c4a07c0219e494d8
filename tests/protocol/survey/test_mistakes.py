"""What people get wrong in a survey, each with the message that it gets."""

from pathlib import Path

import pytest

from tests.protocol.survey.mistakes import FLAT, MISTAKES, RADIUS_M, Mistake
from vsnbench.protocol.survey.check import check_site_file


def test_the_flat_that_mistakes_are_made_on_is_sound() -> None:
    assert check_site_file(FLAT, RADIUS_M)[1] == []


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake.what)
def test_a_mistake_is_named_with_its_place_and_its_mend(mistake: Mistake, tmp_path: Path) -> None:
    _, findings = check_site_file(mistake.file(tmp_path), RADIUS_M)
    told = [(finding.code, finding.message) for finding in findings]
    assert [message for code, message in told if code == mistake.code and mistake.says in message], told


def test_at_least_thirty_mistakes_are_tried() -> None:
    assert len({mistake.what for mistake in MISTAKES}) >= 30
