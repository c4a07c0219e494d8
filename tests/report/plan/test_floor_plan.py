"""The floor plan shows the site's elements to scale."""

from pathlib import Path

import numpy as np
import pytest

from vsnbench.report.plan.floor_plan import PlanStyle, draw_floor_plan, save_floor_plan
from vsnbench.report.plan.furniture import GOAL_COLORS
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.site import Site, load_site


@pytest.fixture(scope="module")
def apartment() -> Site:
    return load_site("apartment")


def words_on(site: Site, style: PlanStyle | None = None) -> list[str]:
    return [text.get_text() for text in draw_floor_plan(site, style=style).texts]


def test_every_goal_category_has_its_own_colour() -> None:
    assert set(GOAL_COLORS) == set(GOAL_CATEGORIES)
    assert len(set(GOAL_COLORS.values())) == len(GOAL_CATEGORIES)


def test_every_room_start_and_goal_instance_is_named(apartment: Site) -> None:
    words = words_on(apartment)
    assert {room.name for room in apartment.rooms} <= set(words)
    for start in apartment.starts:
        assert str(start.number) in words
    for goal in GOAL_CATEGORIES:
        assert words.count(goal) == len(apartment.instances(goal))


def test_a_bare_plan_has_no_words(apartment: Site) -> None:
    bare = PlanStyle(starts=False, labels=False, room_names=False, scale_bar=False, legend=False)
    assert words_on(apartment, bare) == []


def test_only_the_highlighted_goal_is_in_colour(apartment: Site) -> None:
    from matplotlib.colors import to_hex

    axes = draw_floor_plan(apartment, style=PlanStyle(highlight="bed", legend=False))
    shown = {to_hex(face) for layer in axes.collections for face in np.atleast_2d(layer.get_facecolor())}
    assert GOAL_COLORS["bed"] in shown
    assert GOAL_COLORS["sofa"] not in shown


def test_it_is_drawn_at_scale_and_holds_the_whole_site(apartment: Site) -> None:
    axes = draw_floor_plan(apartment)
    assert axes.get_aspect() == 1.0
    for wall in apartment.walls:
        x_min, y_min, x_max, y_max = wall.shape.bounds
        assert axes.get_xlim()[0] < x_min < x_max < axes.get_xlim()[1]
        assert axes.get_ylim()[0] < y_min < y_max < axes.get_ylim()[1]


def test_the_legend_of_a_narrow_site_goes_below_the_scale_bar(apartment: Site) -> None:
    bedroom = apartment.model_copy(
        update={"walls": [wall for wall in apartment.walls if min(wall.start[0], 6) == 6][:1]}
    )
    for site, same_row in ((apartment, True), (bedroom, False)):
        heights = {text.get_text(): text.get_position()[1] for text in draw_floor_plan(site).texts}
        assert (abs(heights["2 m"] - heights["bed (1)"]) < 0.1) is same_row


def test_it_draws_into_axes_that_are_given(apartment: Site) -> None:
    from matplotlib.figure import Figure

    axes = Figure().add_subplot()
    assert draw_floor_plan(apartment, axes) is axes
    drawn = sum(len(layer.get_paths()) for layer in axes.collections)
    assert drawn > len([thing for thing in apartment.objects if thing.category != "picture"])


def test_the_same_site_gives_the_same_svg(apartment: Site, tmp_path: Path) -> None:
    for name in ("one.svg", "other.svg"):
        save_floor_plan(apartment, tmp_path / name)
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "other.svg").read_bytes()
    assert (tmp_path / "one.svg").read_text(encoding="utf-8").lstrip().startswith("<?xml")
