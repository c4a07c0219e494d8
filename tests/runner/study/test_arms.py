from pathlib import Path
from typing import Any

import pytest

from tests.study.studies import small_study
from vsnbench.errors import StudyError
from vsnbench.runner.study.arms import StudyPlace, check_progress
from vsnbench.settings.yaml_text import dump_yaml
from vsnbench.sites.site import load_site
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


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"starting_positions": "1-5"}, "5 starting positions are too few"),
        ({"starting_positions": "3"}, "1 starting position is too few"),
        ({"starting_positions": "1-9", "looks": [6, 12]}, "looks: 12 is after the last of 9 starting positions"),
        (
            {"starting_positions": "3", "primary": {"kind": "equivalence"}, "margin": 0.2},
            "even equal results of all trials would decide nothing",
        ),
    ],
)
def test_a_study_at_looks_that_can_decide_nothing_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(StudyError, match=words):
        StudyPlace.of(small_study(stopping="decided", **changes), Path())


def test_a_locked_study_with_too_few_positions_can_be_read() -> None:
    study = small_study(**LIKE, starting_positions="1-6")
    assert len(StudyPlace.of(study, Path(), "locked").schedule.trials) == 24


def test_a_person_is_no_arm() -> None:
    place = StudyPlace.of(small_study(arms={"us": {"model": "random"}, "ada": {"model": "human:ada"}}), Path())
    with place.robot() as robot, pytest.raises(StudyError, match="arm ada: study: human:ada is a person"):
        place.load("ada", robot)


def test_progress_to_a_goal_that_the_map_has_no_path_to_is_refused(tmp_path: Path) -> None:
    content = load_site("apartment").model_dump(mode="json")
    for door in content["doors"]:
        door["closed"] = door["closed"] or door["name"] == "bedroom door"
    (tmp_path / "flat.yaml").write_text(dump_yaml(content))
    fields = {"site": "flat.yaml", "goals": ["bed"], "starting_positions": "1-15"}
    radius_m = 0.177
    with pytest.raises(StudyError, match="no path there") as refused:
        check_progress(StudyPlace.of(small_study(**fields, primary={"metric": "progress"}), tmp_path), radius_m)
    assert refused.value.code == "no-progress"
    check_progress(StudyPlace.of(small_study(**fields), tmp_path), radius_m)
    check_progress(StudyPlace.of(small_study(primary={"metric": "progress"}), tmp_path), radius_m)
