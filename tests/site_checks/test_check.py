"""`check_site` finds mistakes in a survey; test_mistakes.py has those that the docs show."""

import pytest

from vsnbench.site_checks.check import check_site
from vsnbench.site_checks.finding import Severity
from vsnbench.sites.site import Door, Room, Site, SiteObject, StartingPosition, Wall, Window, load_site

RADIUS_M = 0.177
SIZES = {
    "chair": (0.5, 0.5, 0.9),
    "sofa": (0.9, 1.6, 0.8),
    "table": (0.8, 0.8, 0.7),
    "bed": (1.9, 0.9, 0.5),
    "toilet": (0.6, 0.4, 0.8),
    "plant": (0.4, 0.4, 1.0),
}
PLACES = {"chair": (9, 1), "sofa": (9, 3), "table": (9, 5), "bed": (7, 7), "toilet": (4, 7.5), "plant": (1, 7)}


def thing(name: str, category: str, at: tuple[float, float], size_m: tuple[float, float, float], **more) -> SiteObject:
    return SiteObject(id=name, category=category, position=at, size_m=size_m, **more)


def sound_site(**changes) -> Site:
    """A hall of 10 m x 8 m with every goal along its walls and 15 starts in its middle."""
    objects = [thing(f"{name}-1", name, PLACES[name], SIZES[name]) for name in PLACES]
    objects.append(thing("monitor-1", "monitor", PLACES["table"], (0.2, 0.5, 0.4), elevation_m=0.7))
    content = {
        "name": "hall",
        "rooms": [Room(name="hall", polygon=[(0, 0), (10, 0), (10, 8), (0, 8)])],
        "walls": [
            Wall(start=(0, 0), end=(10, 0)),
            Wall(start=(10, 0), end=(10, 8)),
            Wall(start=(10, 8), end=(0, 8)),
            Wall(start=(0, 8), end=(0, 0)),
        ],
        "objects": objects,
        "starts": [
            StartingPosition(number=n, position=(1 + 0.8 * (n % 5), 1 + n // 5), heading_deg=17.0 * n)
            for n in range(1, 16)
        ],
    }
    return Site(**{**content, **changes})


def errors_of(site: Site) -> list[str]:
    return [finding.message for finding in check_site(site, RADIUS_M) if finding.severity is Severity.ERROR]


def with_objects(*more: SiteObject) -> Site:
    return sound_site(objects=[*sound_site().objects, *more])


def with_start(*position: float) -> Site:
    starts = sound_site().starts
    return sound_site(starts=[starts[0].model_copy(update={"position": position}), *starts[1:]])


@pytest.mark.parametrize("radius_m", [0.177, 0.30])
def test_the_apartment_is_sound_for_both_robots(radius_m: float) -> None:
    assert check_site(load_site("apartment"), radius_m) == []


def test_a_sound_site_has_no_findings() -> None:
    assert check_site(sound_site(), RADIUS_M) == []


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        ((0.0, 3.0), "is inside wall 4"),
        ((8.4, 3.0), "0.15 m from sofa-1"),
    ],
)
def test_a_start_without_space_for_the_robot_is_an_error(position: tuple[float, float], expected: str) -> None:
    messages = [message for message in errors_of(with_start(*position)) if message.startswith("start 1 ")]
    assert len(messages) == 1
    assert expected in messages[0]


def test_fewer_than_fifteen_starts_is_a_warning() -> None:
    (finding,) = check_site(sound_site(starts=sound_site().starts[:14]), RADIUS_M)
    assert finding.severity is Severity.WARNING
    assert "14 starting positions" in finding.message


def test_an_enclosed_goal_is_an_error() -> None:
    around_the_toilet = [
        Wall(start=(2.3, 8), end=(2.3, 5.9)),
        Wall(start=(2.3, 5.9), end=(5.7, 5.9)),
        Wall(start=(5.7, 5.9), end=(5.7, 8)),
    ]
    site = sound_site(walls=[*sound_site().walls, *around_the_toilet])
    (message,) = errors_of(site)
    assert message.startswith("toilet-1 is enclosed: no start can reach a toilet")


def test_an_enclosed_start_is_named() -> None:
    fence = [
        thing("fence-1", "counter", (0.75, 7.0), (0.1, 1.3, 0.9)),
        thing("fence-2", "counter", (0.45, 6.3), (0.6, 0.1, 0.9)),
    ]
    site = with_objects(*fence)
    site = site.model_copy(
        update={
            "objects": [each for each in site.objects if each.id != "plant-1"]
            + [thing("plant-1", "plant", (3, 0.4), SIZES["plant"])],
            "starts": [site.starts[0].model_copy(update={"position": (0.38, 6.9)}), *site.starts[1:]],
        }
    )
    assert any(
        "between wall 3 (from (10, 8) to (0, 8)) and fence-1 is 0.30 m wide, the robot needs 0.35: start 1 cannot"
        in message
        for message in errors_of(site)
    )


def test_any_word_is_a_category_and_a_near_miss_is_a_warning() -> None:
    assert errors_of(with_objects(thing("piano-1", "piano", (5, 5), (1, 1, 1)))) == []
    found = check_site(with_objects(thing("sofa-2", "soffa", (5, 5), (1, 1, 1))), RADIUS_M)
    (near,) = [finding for finding in found if finding.code == "near-category"]
    assert (near.severity, near.subject) == (Severity.WARNING, "sofa-2")
    (message,) = errors_of(with_objects(thing("sofa-3", "round sofa", (5, 5), (1, 1, 1))))
    assert "sofa-3" in message


@pytest.mark.parametrize(
    ("extra", "expected"),
    [
        (
            thing("lamp-1", "lamp", (12, 3), (0.3, 0.3, 1)),
            "lamp-1 at (12, 3) is outside every room, 1.85 m from the nearest",
        ),
        (thing("lamp-1", "lamp", (5, 5), (0.3, 0.3, 2.6)), "lamp-1 reaches 0.10 m above the ceiling of 2.5 m"),
    ],
)
def test_an_object_in_an_impossible_place_is_an_error(extra: SiteObject, expected: str) -> None:
    messages = errors_of(with_objects(extra))
    assert any(expected in message for message in messages), messages


def test_stacked_objects_do_not_overlap() -> None:
    lamp = thing("lamp-1", "lamp", PLACES["sofa"], (0.3, 0.3, 0.5), elevation_m=0.8)
    assert check_site(with_objects(lamp), RADIUS_M) == []


def test_walls_that_meet_or_cross_do_not_overlap() -> None:
    walls = [*sound_site().walls, Wall(start=(4.5, 0), end=(4.5, 0.8))]
    assert [message for message in errors_of(sound_site(walls=walls)) if "overlap" in message] == []


def test_a_door_and_a_window_off_their_walls_are_errors() -> None:
    site = sound_site(
        doors=[Door(name="front door", start=(3, 1), end=(4, 1))], windows=[Window(start=(3, 0), end=(3, 1))]
    )
    door, window = errors_of(site)
    assert door.startswith(
        "door `front door` (from (3, 1) to (4, 1)) is not on a wall: the centre line of wall 1 (from (0, 0) to (10, 0))"
    )
    assert "is 1.00 m away" in door
    assert window.startswith("window 1 (from (3, 0) to (3, 1)) is not on a wall")


def test_errors_come_before_warnings() -> None:
    site = with_objects(thing("piano-1", "grand piano", (5, 5), (1, 1, 1)))
    site = site.model_copy(update={"starts": site.starts[:3]})
    assert [finding.severity for finding in check_site(site, RADIUS_M)] == [Severity.ERROR, Severity.WARNING]


def test_a_wider_robot_finds_more() -> None:
    site = with_start(0.45, 3.0)
    assert errors_of(site) == []
    (finding,) = check_site(site, 0.45)
    assert finding.subject == "start 1"
    assert "is 0.40 m from wall 4 (from (0, 8) to (0, 0)), less than the robot's radius of 0.45 m" in finding.problem
    assert finding.advice == "move it 0.06 m away"


def without_wall(*numbers: int) -> Site:
    walls = sound_site().walls
    return sound_site(walls=[wall for number, wall in enumerate(walls, start=1) if number not in numbers])


def test_a_missing_wall_is_an_error_that_names_the_edge_and_its_place() -> None:
    (finding,) = [each for each in check_site(without_wall(3), RADIUS_M) if each.severity is Severity.ERROR]
    assert finding.subject == "the hall's edge from (10, 8) to (0, 8)"
    assert "has no wall" in finding.message
    assert finding.place.points == ((10, 8), (0, 8))


def test_a_corner_off_its_wall_is_named_instead_of_the_wall() -> None:
    rooms = sound_site().rooms
    polygon = [(10.0, 0.12) if corner == (10.0, 0.0) else corner for corner in rooms[0].polygon]
    skew = sound_site(rooms=[rooms[0].model_copy(update={"polygon": polygon}), *rooms[1:]])
    assert (10.0, 0.0) in rooms[0].polygon
    (message,) = (each for each in errors_of(skew) if "has no wall" in each)
    assert "move its corner (10, 0.12) to (10, 0), in line with wall 1 (from (0, 0) to (10, 0))" in message


def test_the_inner_face_and_the_centre_line_of_a_wall_both_close_a_room() -> None:
    inside = [Room(name="hall", polygon=[(0.05, 0.05), (9.95, 0.05), (9.95, 7.95), (0.05, 7.95)])]
    assert errors_of(sound_site(rooms=inside)) == []


def test_an_open_outer_door_and_a_narrow_door_are_warnings() -> None:
    out = sound_site(doors=[Door(name="front door", start=(3, 0), end=(4, 0))])
    assert [each.subject for each in check_site(out, RADIUS_M)] == ["door `front door`"]
    narrow = sound_site(
        walls=[*sound_site().walls, Wall(start=(0, 5.2), end=(10, 5.2))],
        doors=[Door(name="slit", start=(4, 5.2), end=(4.3, 5.2))],
    )
    assert any(
        "slit" in each.message and "0.30 m clear, the robot needs 0.35" in each.message
        for each in check_site(narrow, RADIUS_M)
    )


def test_an_object_in_the_air_is_a_warning() -> None:
    (finding,) = check_site(
        with_objects(thing("screen", "monitor", (5, 5), (0.2, 0.5, 0.4), elevation_m=0.74)), RADIUS_M
    )
    assert "screen at (5, 5) is 0.74 m above the floor or object under it" in finding.message


def test_a_trivial_start_is_reported_once_per_goal_and_may_be_excluded() -> None:
    site = with_start(8.0, 3.0)
    (finding,) = check_site(site, RADIUS_M)
    assert finding.message.startswith("goal sofa is reached without a move from start 1 (sofa-1)")
    assert "not_for: [sofa]" in finding.message
    excluded = [site.starts[0].model_copy(update={"not_for": ["sofa"]}), *site.starts[1:]]
    assert check_site(site.model_copy(update={"starts": excluded}), RADIUS_M) == []


def test_all_findings_are_reported_together() -> None:
    site = with_objects(
        thing("piano-1", "grand piano", (5, 5), (1, 1, 1)), thing("lamp-1", "lamp", (12, 3), (0.3, 0.3, 1))
    )
    site = site.model_copy(update={"walls": site.walls[:3]})
    assert {"piano-1", "lamp-1", "the hall's edge from (0, 8) to (0, 0)"} <= {
        each.subject for each in check_site(site, RADIUS_M)
    }


@pytest.mark.parametrize(("heading", "degrees"), [(3.14, "180"), (-1.5708, "-90"), (0.785, "45")])
def test_a_single_heading_in_radians_is_a_warning(heading: float, degrees: str) -> None:
    site = sound_site()
    turned = site.starts[3].model_copy(update={"heading_deg": heading})
    site = sound_site(starts=[*site.starts[:3], turned, *site.starts[4:]])
    (finding,) = (found for found in check_site(site, RADIUS_M) if found.code == "headings-in-radians")
    assert finding.severity is Severity.WARNING
    assert f"{degrees}°" in finding.advice
    assert finding.entries == (("starts", 3),)


def test_a_small_heading_that_is_no_multiple_of_an_eighth_turn_is_none() -> None:
    site = sound_site()
    turned = site.starts[3].model_copy(update={"heading_deg": 3.5})
    site = sound_site(starts=[*site.starts[:3], turned, *site.starts[4:]])
    assert not [found for found in check_site(site, RADIUS_M) if found.code == "headings-in-radians"]


@pytest.mark.parametrize(("survey_error_m", "expected"), [(0.01, 1), (0.03, 0)])
def test_an_object_may_reach_into_a_wall_by_the_error_of_the_survey(survey_error_m: float, expected: int) -> None:
    shelf = thing("shelf-1", "bookshelf", (5, 0.05 + 0.15 - 0.02), (0.3, 0.9, 1.9), heading_deg=90)
    site = sound_site(objects=[*sound_site().objects, shelf], survey_error_m=survey_error_m)
    assert len([error for error in errors_of(site) if "into wall" in error]) == expected
