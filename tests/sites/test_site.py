"""The embedded apartment meets the protocol, and errors in site files name line and field."""

import re
from collections import Counter
from pathlib import Path

import pytest
from shapely.geometry import Point

from vsnbench.errors import SiteError, UsageError
from vsnbench.sites.categories import CATEGORIES, GOAL_CATEGORIES
from vsnbench.sites.site import Site, embedded_sites, load_site, parse_site, site_file_faults


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
    assert door.clear_width_m == pytest.approx(0.70)
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


@pytest.mark.parametrize(
    ("broken", "instead", "field"),
    [
        ("ceiling_height_m: 2.5", "ceiling_height_m: low", "ceiling_height_m"),
        ("sill_m: 0.5", "sill_m: -0.5", "windows.0.sill_m"),
        ("size_m: [0.95, 2.1, 0.8]", "size_m: [0.95, 2.1]", "objects.12.size_m"),
        ("id: sofa-1", "id: The Sofa", "objects.12.id"),
        ("heading_deg: 195", "heading: 195", "starts.0.heading (number 1): unknown field"),
        ("start: [-0.1, -0.1], end: [10.1, -0.1]", "start: [1, 1], end: [1, 1]", "walls.0: start and end are the same"),
        ("start: [6.7, 3.9], end: [7.5, 3.9]", "start: [6.7, 3.9], end: [6.7, 3.9]", "doors.1: start and end are the"),
        ("sill_m: 1.0", "sill_m: 2.1", "windows.1: head_m of 2.1 m is not above sill_m"),
        ("thickness_m: 0.2", "thickness_m: -0.2", "walls.0.thickness_m"),
        (
            "position: [3.45, 1.9]",
            "position: [.nan, 1.9]",
            "objects.12.position.0 (sofa-1): expected a number",
        ),
        (
            "position: [3.45, 1.9]",
            "position: [345, 190]",
            "objects.12.position.0 (sofa-1): 345 m is more than 200 m from the origin: this looks like centimetres",
        ),
        (
            "position: [3.45, 1.9]",
            "position: [3,45, 1.9]",
            "objects.12.position (sofa-1): expected 2 values, got 3: is this a decimal comma?",
        ),
        (
            "polygon: [[7.6, 0], [10, 0], [10, 2.5]",
            "polygon: [[7.6, 0], [10, 2.5], [10, 0]",
            "rooms.2.polygon (bathroom): the outline crosses",
        ),
        (
            "position: [3.45, 1.9]",
            "position: [3, 2], footprint: [[1, 1], [2, 2], [1, 2], [2, 1]]",
            "objects.12.footprint (sofa-1): the outline crosses",
        ),
    ],
)
def test_a_broken_file_names_line_and_field(broken: str, instead: str, field: str) -> None:
    lines = embedded_sites()["apartment"].read_text(encoding="utf-8").splitlines()
    at = next(number for number, line in enumerate(lines) if broken in line)
    lines[at] = lines[at].replace(broken, instead)
    with pytest.raises(SiteError, match=re.escape(f"flat.yaml:{at + 1}:")) as raised:
        parse_site("\n".join(lines), "flat.yaml")
    assert field in str(raised.value)
    assert "\n" not in str(raised.value)


def test_invalid_yaml_names_the_line() -> None:
    with pytest.raises(SiteError, match=r"flat\.yaml:3") as refused:
        parse_site("name: flat\nrooms: [[\nwalls: }", "flat.yaml")
    assert refused.value.code == "invalid-yaml"


@pytest.mark.parametrize(
    ("name", "twin", "message"),
    [
        ("name: bedroom door", "name: bathroom door", "doors: bathroom door is repeated"),
        ("id: chair-2", "id: chair-1", "objects: chair-1 is repeated"),
        ("number: 2, ", "number: 1, ", "starts: 1 is repeated"),
        ("name: bedroom\n", "name: bathroom\n", "rooms: bathroom is repeated"),
    ],
)
def test_a_repeated_name_is_reported_with_its_list(name: str, twin: str, message: str) -> None:
    text = embedded_sites()["apartment"].read_text(encoding="utf-8")
    line = text[: text.index(f"\n{message.partition(':')[0]}:")].count("\n") + 2
    with pytest.raises(SiteError, match=re.escape(f"flat.yaml:{line}: {message}")):
        parse_site(text.replace(name, twin, 1), "flat.yaml")


def test_an_unknown_site_names_the_embedded_sites() -> None:
    with pytest.raises(UsageError, match="apartment") as refused:
        load_site("castle")
    assert refused.value.code == "unknown-site"


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


def test_only_a_goal_of_the_site_can_be_excluded(tmp_path: Path) -> None:
    text = embedded_sites()["apartment"].read_text(encoding="utf-8")
    file = tmp_path / "lab.yaml"
    for word, faults in (("refrigerator", 0), ("piano", 1)):
        start = 'heading_deg: 195, note: "bedroom, before the wardrobe, facing the wall"'
        assert start in text
        file.write_text(text.replace(start, f"heading_deg: 195, not_for: [{word}]"), encoding="utf-8")
        assert len(site_file_faults(file)) == faults
