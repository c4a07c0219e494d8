"""The embedded apartment meets the protocol, and errors in site files name line and field."""

from collections import Counter

import pytest
from shapely.geometry import Point

from vsnbench.errors import UsageError
from vsnbench.sites.categories import CATEGORIES, GOAL_CATEGORIES
from vsnbench.sites.site import Site, embedded_sites, load_site, parse_site


@pytest.fixture(scope="module")
def apartment() -> Site:
    return load_site("apartment")


def test_the_apartment_is_about_75_square_metres(apartment: Site) -> None:
    assert 70 <= apartment.area_m2 <= 80


def test_the_apartment_has_the_three_areas_of_the_paper(apartment: Site) -> None:
    assert {room.name for room in apartment.rooms} == {"living space", "bedroom", "bathroom"}


def test_the_bathroom_lies_behind_a_narrow_door(apartment: Site) -> None:
    door = next(door for door in apartment.doors if door.name == "bathroom door")
    bathroom = next(room for room in apartment.rooms if room.name == "bathroom")
    assert door.length_m == pytest.approx(0.70)
    assert door.centre_line.distance(bathroom.shape) < 0.01
    others = [each for each in apartment.doors if each is not door and not each.closed]
    assert all(each.centre_line.distance(bathroom.shape) > 0.5 for each in others)


def test_the_apartment_has_every_goal_in_believable_numbers(apartment: Site) -> None:
    count = Counter(thing.category for thing in apartment.objects)
    assert set(GOAL_CATEGORIES) <= set(count) <= CATEGORIES
    assert count["chair"] >= 5
    assert count["sofa"] == count["bed"] == count["toilet"] == 1
    assert 1 <= count["monitor"] <= 2
    assert 1 <= count["plant"] <= 2


def test_the_apartment_has_fifteen_starts_in_every_room(apartment: Site) -> None:
    assert [start.number for start in apartment.starts] == list(range(1, 16))
    for room in apartment.rooms:
        assert any(room.shape.contains(Point(start.position)) for start in apartment.starts), room.name


def test_start_10_faces_the_refrigerator_close_by(apartment: Site) -> None:
    start = apartment.start(10)
    (refrigerator,) = apartment.instances("refrigerator")
    ahead = [start.pose.compose(type(start.pose)(0.1 * step, 0.0)).position for step in range(1, 9)]
    assert any(refrigerator.shape.contains(Point(point)) for point in ahead)


def test_the_hash_follows_the_content_and_not_the_formatting(apartment: Site) -> None:
    text = embedded_sites()["apartment"].read_text(encoding="utf-8")
    assert parse_site("# a comment\n" + text, "copy.yaml").sha256 == apartment.sha256
    assert parse_site(text.replace("heading_deg: 195", "heading_deg: 196"), "copy.yaml").sha256 != apartment.sha256


def test_an_unknown_start_names_the_starts(apartment: Site) -> None:
    with pytest.raises(UsageError) as refused:
        apartment.start(20)
    assert refused.value.code == "unknown-start"
    assert "1, 2, 3" in refused.value.advice


def test_a_changed_copy_has_no_cached_values(apartment: Site) -> None:
    sofa = apartment.instances("sofa")[0]
    moved = sofa.model_copy(update={"position": (5.0, 5.0)})
    assert sofa.shape.centroid.x == pytest.approx(3.45)
    assert moved.shape.centroid.x == pytest.approx(5.0)
    assert apartment.model_copy(update={"objects": [moved]}).sha256 != apartment.sha256


def test_a_start_may_exclude_goals_without_a_change_of_other_hashes() -> None:
    site = load_site("apartment")
    assert site.sha256 == "cd027302a88f41aa97f6d8eceb4905e014c417d5b4573d23f7d7b50a48fdca93"
    assert "not_for" not in site.content()["starts"][0]
    start = site.starts[0].model_copy(update={"not_for": ["toilet", "bed"]})
    excluding = site.model_copy(update={"starts": [start, *site.starts[1:]]})
    assert excluding.excluded == {("toilet", 1), ("bed", 1)}
    assert excluding.sha256 != site.sha256
    assert Site.model_validate(excluding.content()) == excluding


def test_the_default_survey_error_does_not_change_the_hash() -> None:
    site = load_site("apartment")
    assert "survey_error_m" not in site.content()
    coarse = site.model_copy(update={"survey_error_m": 0.03})
    assert coarse.sha256 != site.sha256
    assert Site.model_validate(coarse.content()) == coarse
