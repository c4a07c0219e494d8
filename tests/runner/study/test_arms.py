from pathlib import Path

import pytest

from tests.study.studies import small_study
from vsnbench.errors import StudyError
from vsnbench.runner.study.arms import StudyPlace
from vsnbench.study.schedule import draw_schedule

LIKE = {"stopping": "decided", "about": "cells-like-these"}


def test_a_locked_study_keeps_the_order_in_which_its_blocks_were_drawn() -> None:
    study = small_study(**LIKE, starting_positions="1-9")
    earlier = draw_schedule(small_study(starting_positions="1-9"), tuple(range(1, 10)))
    now = StudyPlace.of(study, Path())
    assert now.schedule.fingerprint != earlier.fingerprint
    assert StudyPlace.of(study, Path(), earlier.fingerprint).schedule == earlier
    assert StudyPlace.of(study, Path(), now.schedule.fingerprint).schedule == now.schedule
    assert StudyPlace.of(study, Path(), "unknown").schedule == now.schedule


def test_a_study_with_too_few_starting_positions_is_refused() -> None:
    with pytest.raises(StudyError, match="6 starting positions are too few"):
        StudyPlace.of(small_study(**LIKE, starting_positions="1-6", repetitions=50), Path())


def test_a_locked_study_with_too_few_positions_can_be_read() -> None:
    study = small_study(**LIKE, starting_positions="1-6")
    assert len(StudyPlace.of(study, Path(), "locked").schedule.trials) == 24
