"""Goals of a site file: what they mean, and which are refused."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.sites.goal_sites import GOALS, write_site
from vsnbench.errors import SiteFileError
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.human_verdict import taped
from vsnbench.protocol.judge import EndReason, distance_to_goal, stop_succeeds
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.site import Site, load_site
from vsnbench.sites.targets import describe_goal, legs_of, targets_of
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.goal import GoalKind
from vsnbench.values.pose import Pose

RULES = ProtocolParameters()


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return load_site(write_site(tmp_path))


def test_goals_do_not_change_the_hash_of_the_site_and_have_their_own(site: Site, tmp_path: Path) -> None:
    assert site.sha256 == load_site("apartment").sha256
    before = {goal.id: goal.sha256 for goal in site.goals}
    changed = load_site(write_site(tmp_path, GOALS.replace("the red armchair", "the old armchair")))
    after = {goal.id: goal.sha256 for goal in changed.goals}
    assert {name for name in before if before[name] != after[name]} == {"red-armchair"}


def test_a_recorded_definition_reads_back_with_the_same_hash(site: Site) -> None:
    back = Site.model_validate({**site.content(), "goals": [goal.content() for goal in site.goals]})
    assert [goal.sha256 for goal in back.goals] == [goal.sha256 for goal in site.goals]


def test_a_policy_receives_words_or_the_photograph(site: Site) -> None:
    assert describe_goal(site, "red-armchair", Pose(0.0, 0.0)) == "the red armchair"
    assert describe_goal(site, "cold-box", Pose(0.0, 0.0)) == "refrigerator"
    photo = describe_goal(site, "photo-bed", Pose(0.0, 0.0))
    assert (photo.kind, None if photo.image is None else photo.image.shape) == (GoalKind.IMAGE, (48, 64, 3))


def test_targets_are_objects_categories_points_and_regions(site: Site) -> None:
    found = {goal.id: [target.id for target in targets_of(site, goal.id)] for goal in site.goals}
    assert found["red-armchair"] == ["armchair"]
    assert found["cold-box"] == ["refrigerator-1"]
    assert found["window-corner"] == ["point:1"]
    assert found["to-the-kitchen"] == ["region:kitchen"]


def test_a_region_is_reached_only_with_the_base_inside_it(site: Site) -> None:
    inside, outside = Pose(1.5, 6.2), Pose(1.5, 5.85)
    assert stop_succeeds(site, "to-the-kitchen", inside, RULES) == "region:kitchen"
    assert stop_succeeds(site, "to-the-kitchen", outside, RULES) is None
    measured = distance_to_goal(site, "to-the-kitchen", Fix(outside, PoseSource.SURVEYED), RULES)
    assert (measured.distance_m, measured.in_sight) == (pytest.approx(0.05), False)
    for distance_m, success in ((0.0, True), (0.05, False)):
        assert taped(EndReason.STOP, 9, distance_m, "region:kitchen", RULES).success is success


@pytest.mark.parametrize(("goal", "at"), [("to-the-kitchen", Pose(1.5, 6.2)), ("window-corner", Pose(1.6, 1.0))])
def test_the_shortest_path_is_zero_where_stop_succeeds(site: Site, goal: str, at: Pose) -> None:
    space = free_space(site, 0.177)
    assert stop_succeeds(site, goal, at, RULES)
    assert space.geodesic_to_goal_m(at, goal, RULES) == pytest.approx(0.0, abs=1e-6)
    assert 2 < space.geodesic_to_goal_m(site.start(1).pose, goal, RULES) < 20


def test_an_instruction_has_trials_from_its_starts_only(site: Site) -> None:
    assert {number for goal, number in site.excluded if goal == "to-the-kitchen"} == set(range(4, 16))


def test_a_route_needs_two_photographs_and_keeps_their_order(tmp_path: Path) -> None:
    route = "goals:\n  - {id: way, kind: route, images: [bed.png, other.png], targets: [bed-1]}\n"
    (tmp_path / "other.png").write_bytes(cv2.imencode(".png", np.zeros((48, 64, 3), np.uint8))[1].tobytes())
    told = describe_goal(load_site(write_site(tmp_path, route)), "way", Pose(0.0, 0.0))
    assert (str(told), told.kind, [bool(image.any()) for image in told.images]) == (
        "way",
        GoalKind.ROUTE,
        [True, False],
    )
    with pytest.raises(SiteFileError, match="one photograph"):
        load_site(write_site(tmp_path, route.replace(", other.png", "")))


def test_a_sequence_has_the_definitions_of_its_goals(tmp_path: Path) -> None:
    tour = GOALS + "  - {id: tour, kind: sequence, goals: [couch, red-armchair]}\n"
    site = load_site(write_site(tmp_path, tour))
    changed = load_site(write_site(tmp_path, tour.replace("the red armchair", "the old armchair")))
    assert legs_of(site, "tour") == ("sofa", "red-armchair")
    assert [target.id for target in targets_of(site, "tour")] == ["sofa-1", "armchair"]
    before, after = (each.goal("tour") for each in (site, changed))
    assert before is not None
    assert after is not None
    assert before.sha256 != after.sha256
    alone = Site.model_validate({**site.content(), "goals": [before.content()]})  # as the record of its trials has it
    assert [target.id for target in targets_of(alone, "red-armchair")] == ["armchair"]
    assert alone.goals[0].sha256 == before.sha256


def test_a_point_may_be_in_an_open_door_but_not_in_a_closed_one() -> None:
    apartment = load_site("apartment").content()

    def with_point(door: dict[str, Any]) -> Site:
        (x0, y0), (x1, y1) = door["start"], door["end"]
        goal = {"id": "a", "kind": "point", "targets": [{"point": [(x0 + x1) / 2, (y0 + y1) / 2]}]}
        return Site.model_validate({**apartment, "goals": [goal]})

    assert with_point(next(door for door in apartment["doors"] if not door["closed"])).goals
    with pytest.raises(ValueError, match="in a wall"):
        with_point(next(door for door in apartment["doors"] if door["closed"]))
