import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Point, Polygon

from tests.simulator.scenery import LOOKS, a_site
from vsnbench.errors import SiteError
from vsnbench.simulator.furniture import MODELS
from vsnbench.simulator.furniture.canvas import extents, rotation_matrix
from vsnbench.simulator.primitives import Primitive, Shape
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.categories import CATEGORIES
from vsnbench.sites.site import Door, Site, SiteObject, load_site


def corners(primitive: Primitive) -> list[tuple[float, float]]:
    """The floor-plan corners of a primitive's own box: a hull of every shape that is upright."""
    rows = rotation_matrix(primitive.rotation)
    reach = extents(primitive.shape, primitive.half_size, primitive.rotation)
    if primitive.shape is not Shape.BOX:
        return [
            (primitive.centre[0] + sx * reach[0], primitive.centre[1] + sy * reach[1])
            for sx in (-1, 1)
            for sy in (-1, 1)
        ]
    return [
        tuple(
            primitive.centre[axis]
            + sum(
                rows[axis][k] * sign * half
                for k, (sign, half) in enumerate(zip(signs, primitive.half_size, strict=True))
            )
            for axis in (0, 1)
        )
        for signs in [(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
    ]


def parts_of(site: Site, index: int = 0) -> list[Primitive]:
    return [part for part in build_scene(site).primitives if part.instance == index + 1]


def test_every_category_has_a_look() -> None:
    assert set(MODELS) == CATEGORIES


@pytest.mark.parametrize(("category", "model"), LOOKS)
def test_a_look_fills_the_objects_box(category: str, model: str) -> None:
    sizes = {"rug": (1.6, 0.9, 0.01), "picture": (0.03, 0.8, 0.6), "lamp": (0.3, 0.3, 1.2), "plant": (0.5, 0.5, 1.1)}
    size = sizes.get(category, (0.6, 0.8, 0.9))
    thing = SiteObject(id="thing", category=category, model=model, position=(3, 2), size_m=size)
    parts = parts_of(a_site(thing))
    reach = [extents(part.shape, part.half_size, part.rotation) for part in parts]
    for axis, centre in enumerate((3.0, 2.0, size[2] / 2)):
        low = min(part.centre[axis] - r[axis] for part, r in zip(parts, reach, strict=True))
        high = max(part.centre[axis] + r[axis] for part, r in zip(parts, reach, strict=True))
        assert low >= centre - size[axis] / 2 - 1e-9
        assert high <= centre + size[axis] / 2 + 1e-9
        assert high - low >= 0.8 * size[axis]


@given(
    look=st.sampled_from(LOOKS),
    depth=st.floats(0.02, 3),
    width=st.floats(0.02, 3),
    height=st.floats(0.005, 2.5),
    heading_deg=st.floats(-360, 360),
)
@settings(max_examples=150, deadline=None)
def test_no_part_leaves_the_footprint(
    look: tuple[str, str], depth: float, width: float, height: float, heading_deg: float
) -> None:
    thing = SiteObject(
        id="thing",
        category=look[0],
        model=look[1],
        position=(3, 2),
        heading_deg=heading_deg,
        size_m=(depth, width, height),
        elevation_m=0.3,
    )
    upright = SiteObject.model_validate(thing.model_dump() | {"heading_deg": 0.0})
    turned, straight = parts_of(a_site(thing)), parts_of(a_site(upright))
    assert turned
    assert len(turned) == len(straight)
    yaw = math.radians(heading_deg)
    for part, plain in zip(turned, straight, strict=True):
        for x, y in corners(plain):
            assert abs(x - 3) <= depth / 2 + 1e-9
            assert abs(y - 2) <= width / 2 + 1e-9
        reach = extents(plain.shape, plain.half_size, plain.rotation)[2]
        assert plain.centre[2] - reach >= 0.3 - 1e-9
        assert plain.centre[2] + reach <= 0.3 + height + 1e-9
        dx, dy = plain.centre[0] - 3, plain.centre[1] - 2
        assert part.centre[0] == pytest.approx(3 + math.cos(yaw) * dx - math.sin(yaw) * dy)
        assert part.centre[1] == pytest.approx(2 + math.sin(yaw) * dx + math.cos(yaw) * dy)
        assert math.hypot(*part.rotation) == pytest.approx(1)


def test_a_surveyed_outline_is_what_collides() -> None:
    outline = [(2.0, 1.0), (4.0, 1.0), (4.0, 1.5), (2.6, 1.5), (2.6, 3.0), (2.0, 3.0)]
    thing = SiteObject(id="corner", category="sofa", position=(3, 2), size_m=(2, 2, 0.8), footprint=outline)
    solids = [part for part in parts_of(a_site(thing)) if part.solid]
    shape = Polygon(outline)
    assert solids
    assert all(shape.buffer(1e-6).covers(Polygon(corners(part)).convex_hull) for part in solids)
    assert sum(4 * part.half_size[0] * part.half_size[1] for part in solids) == pytest.approx(shape.area, abs=1e-3)


def test_a_round_outline_collides_inside_itself() -> None:
    shape = Point(3, 2).buffer(0.5)
    outline = list(shape.exterior.coords)[:-1]
    thing = SiteObject(id="round", category="table", position=(3, 2), size_m=(1, 1, 0.7), footprint=outline)
    solids = [part for part in parts_of(a_site(thing)) if part.solid]
    assert all(shape.buffer(1e-6).covers(Polygon(corners(part)).convex_hull) for part in solids)
    assert sum(4 * part.half_size[0] * part.half_size[1] for part in solids) > 0.9 * shape.area


def things_on_tables(*objects: SiteObject) -> list[Primitive]:
    return [part for part in build_scene(a_site(*objects)).primitives if part.category == "tableware"]


@pytest.mark.parametrize("model", ["dining_table", "coffee_table", "desk"])
def test_things_on_a_table_lie_on_its_top_without_a_contact(model: str) -> None:
    table = SiteObject(
        id="table", category="table", model=model, position=(3, 2), heading_deg=40, size_m=(0.9, 1.6, 0.7)
    )
    things = things_on_tables(table)
    assert things
    for part in things:
        assert not part.solid
        assert part.instance == 0
        assert table.shape.buffer(1e-9).covers(Point(part.centre[:2]))
        assert part.centre[2] - extents(part.shape, part.half_size, part.rotation)[2] >= 0.7 - 1e-9


def test_no_thing_lies_where_another_object_is() -> None:
    table = SiteObject(id="table", category="table", position=(3, 2), size_m=(0.9, 1.6, 0.7))
    screen = SiteObject(id="screen", category="monitor", position=(3, 2.2), size_m=(0.5, 0.8, 0.5), elevation_m=0.7)
    alone, shared = things_on_tables(table), things_on_tables(table, screen)
    assert 0 < len(shared) < len(alone)
    assert not any(screen.shape.contains(Point(part.centre[:2])) for part in shared)


def test_objects_of_the_same_size_and_colour_look_alike_and_others_differ() -> None:
    def look(width: float) -> list[tuple[float, ...]]:
        chair = SiteObject(id="chair", category="chair", position=(3, 2), size_m=(0.5, width, 0.9), color="#336699")
        return [part.centre for part in parts_of(a_site(chair))]

    assert look(0.5) == look(0.5)
    assert len({len(look(0.4 + 0.01 * k)) for k in range(12)}) > 1


def test_objects_that_are_not_solid_have_no_contact() -> None:
    rug = SiteObject(id="rug", category="rug", position=(3, 2), size_m=(2, 1, 0.01), solid=False)
    assert not any(part.solid for part in parts_of(a_site(rug)))


def test_a_rug_and_a_picture_are_never_felt_even_when_the_site_forgets_to_say_so() -> None:
    rug = SiteObject(id="rug", category="rug", position=(3, 2), size_m=(2, 1, 0.01))
    assert not any(part.solid for part in parts_of(a_site(rug)))


def test_the_clear_width_of_a_doorway_is_clear() -> None:
    door = Door(name="door", start=(2.0, 0), end=(2.7, 0), height_m=2.0)
    scene = build_scene(a_site(doors=(door,)))
    opening = LineString([door.start, door.end]).buffer(0.3, cap_style="flat")
    for part in scene.primitives:
        reach = extents(part.shape, part.half_size, part.rotation)
        if part.visible and part.category in ("wall", "door") and part.centre[2] - reach[2] < 2.0 - 1e-6:
            overlap = Polygon(corners(part)).convex_hull.intersection(opening)
            assert overlap.area < 1e-6, part


def test_a_closed_door_fills_its_opening() -> None:
    door = Door(name="front door", start=(2.0, 0), end=(2.9, 0), height_m=2.0, closed=True)
    leaves = [
        part
        for part in build_scene(a_site(doors=(door,))).primitives
        if part.solid and part.category == "door" and part.half_size[0] == pytest.approx(0.45)
    ]
    assert any(part.centre[2] - part.half_size[2] == pytest.approx(0.0, abs=1e-6) for part in leaves)


def test_floors_cover_their_room_whatever_its_outline() -> None:
    slanted = ((0.0, 0.0), (6.0, 0.0), (6.0, 2.5), (4.0, 4.0), (0.0, 4.0))
    scene = build_scene(a_site(polygon=slanted))
    covered = sum(
        4 * part.half_size[0] * part.half_size[1]
        for part in scene.primitives
        if part.category == "floor" and part.half_size[2] < 0.01
    )
    assert covered == pytest.approx(Polygon(slanted).area, rel=1e-3)


def test_only_one_slab_carries_the_robot() -> None:
    felt = [part for part in build_scene(a_site()).primitives if part.category == "floor" and part.solid]
    assert len(felt) == 1
    assert felt[0].centre[2] + felt[0].half_size[2] == 0.0


def test_an_unknown_model_is_refused_with_the_known_ones() -> None:
    thing = SiteObject(id="throne", category="chair", model="throne", position=(3, 2), size_m=(1, 1, 1))
    with pytest.raises(SiteError, match=r"throne.*dining_chair, office_chair"):
        build_scene(a_site(thing))


def test_equal_sites_have_the_same_scene_and_others_their_own() -> None:
    site = load_site("apartment")
    again = load_site("apartment")
    assert build_scene(site) is build_scene(again)
    assert build_scene(site, is_surveyed_only=True) is not build_scene(site)
    fewer = again.model_copy(update={"objects": again.objects[1:]})
    assert len(build_scene(fewer).primitives) < len(build_scene(site).primitives)
