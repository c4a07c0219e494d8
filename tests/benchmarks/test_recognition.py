"""Counting of a detector's boxes: matches, false detections, confusions, and what a view counts as whole or cut."""

import numpy as np
import pytest

from benchmarks import realism
from benchmarks.support.coco_network import Box, Found, overlap
from benchmarks.support.goal_views import CUT_SHARE, WHOLE_SHARE, Extent, Flat, Visible, goal_views, views_without_goal
from benchmarks.support.recognition import (
    NOTHING,
    Recognition,
    confusions,
    false_kinds,
    false_per_image,
    recall,
    recognise,
)
from vsnbench.models.vlv.detectors.coco import CLASSES_80
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.site import load_site

SOFA = Visible("sofa", (100.0, 100.0, 300.0, 200.0))
BED = Visible("bed", (400.0, 100.0, 600.0, 300.0))


def found(label: str, box: Box, score: float = 0.5) -> Found:
    return Found(label, score, box)


def in_sofa_view(*boxes: Found) -> Recognition:
    return recognise([SOFA, BED], SOFA, Extent.WHOLE, boxes)


def test_every_goal_category_has_a_class_of_coco() -> None:
    assert set(realism.CLASS_OF_CATEGORY) == set(GOAL_CATEGORIES)
    assert set(realism.CLASS_OF_CATEGORY.values()) < set(CLASSES_80)


@pytest.mark.parametrize(("right", "recognised"), [(161.0, True), (159.0, False)])
def test_a_goal_is_recognised_from_an_overlap_of_three_tenths(right: float, recognised: bool) -> None:
    box = (100.0, 100.0, right, 200.0)
    assert (overlap(box, SOFA.box) >= 0.3) == recognised
    assert in_sofa_view(found("couch", box)).recognised == recognised


@pytest.mark.parametrize(("score", "recognised"), [(0.26, True), (0.24, False)])
def test_a_box_counts_from_a_score_of_a_quarter(score: float, recognised: bool) -> None:
    row = in_sofa_view(found("couch", SOFA.box, score), found("bed", (0.0, 0.0, 9.0, 9.0), score))
    assert row.recognised == recognised
    assert len(row.false) == recognised


def test_a_missed_goal_is_called_by_the_best_box_on_it() -> None:
    assert in_sofa_view(found("bench", SOFA.box, 0.3), found("bed", SOFA.box, 0.4)).called == "bed"
    assert in_sofa_view(found("couch", SOFA.box, 0.3), found("bed", SOFA.box, 0.4)).called == "couch"
    assert in_sofa_view(found("bed", BED.box)).called == NOTHING


def test_a_false_detection_has_a_goals_class_and_no_object_of_this_class() -> None:
    row = in_sofa_view(
        found("bed", SOFA.box),  # on an object of another class
        found("bed", (410.0, 110.0, 600.0, 300.0)),  # correct
        found("bed", (400.0, 110.0, 590.0, 300.0)),  # correct, although the second on the same bed
        found("chair", (0.0, 300.0, 50.0, 400.0)),  # on the building
        found("bench", SOFA.box),  # not a goal's class
    )
    assert sorted(row.false) == [("bed", "sofa"), ("chair", "building")]


def test_views_without_a_goal_count_for_false_detections_only() -> None:
    rows = [
        in_sofa_view(found("couch", SOFA.box)),
        in_sofa_view(found("bed", SOFA.box)),
        recognise([SOFA], SOFA, Extent.CUT, []),
        recognise([], None, None, [found("bed", SOFA.box), found("tv", SOFA.box)]),
    ]
    whole, cut = (recall(rows, "sofa", extent) for extent in Extent)
    assert (whole.recognised, whole.views, cut.recognised, cut.views) == (1, 2, 0, 1)
    assert recall(rows, "bed", Extent.WHOLE).views == 0
    assert confusions(rows, "sofa") == {"bed": 1, NOTHING: 1}
    assert false_per_image(rows) == 3 / 4
    assert false_kinds(rows) == {("bed", "sofa"): 1, ("bed", "building"): 1, ("tv", "building"): 1}


def test_boxes_end_at_the_edge_of_the_image() -> None:
    assert found("bed", (-5.0, 10.0, 700.0, 490.0)).within(640, 480).box == (0.0, 10.0, 640.0, 480.0)


def test_a_fifth_of_the_seeds_is_held_out() -> None:
    usual, held_out = (set(realism.seeds(held_out=held)) for held in (False, True))
    assert not usual & held_out
    assert usual | held_out == set(realism.SEEDS)
    assert len(held_out) * 5 == len(realism.SEEDS)


@pytest.fixture(scope="module")
def apartment() -> Flat:
    return Flat(load_site("apartment"))


def test_whole_goals_are_off_the_edge_and_cut_ones_are_at_it_or_hidden(apartment: Flat) -> None:
    views = list(goal_views(apartment, "chair", 4, np.random.default_rng(1)))
    assert [view.extent for view in views].count(Extent.WHOLE) == 4
    assert [view.extent for view in views].count(Extent.CUT) == 4
    for view in views:
        assert view.goal is not None
        left, top, right, bottom = view.goal.box
        if view.extent is Extent.WHOLE:
            assert left > 0
            assert top > 0
            assert right < 640
            assert bottom < 480
        assert view.goal.category == "chair"
        assert any(item.box == view.goal.box for item in view.objects)
    assert 0 < CUT_SHARE < WHOLE_SHARE < 1


def test_views_follow_from_the_seed(apartment: Flat) -> None:
    first, again, other = (
        np.stack([view.rgb for view in goal_views(apartment, "sofa", 1, np.random.default_rng(seed))])
        for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_views_without_a_goal_show_no_goal(apartment: Flat) -> None:
    views = list(views_without_goal(apartment, 3, np.random.default_rng(1)))
    assert len(views) == 3
    for view in views:
        assert not {item.category for item in view.objects} & set(GOAL_CATEGORIES)


def test_earlier_figures_get_columns_of_their_own() -> None:
    now = {"a": realism.figures_of([in_sofa_view(found("couch", SOFA.box))])}
    then = {"a": realism.figures_of([in_sofa_view(found("bed", SOFA.box))])}
    header, _, *rows = realism.as_markdown(now, then).splitlines()[2:]
    assert header.startswith("| category | whole before | whole after | cut before | cut after |")
    assert any(row.startswith("| sofa | 0% (0/1) | 100% (1/1) | – | – |") for row in rows)
    assert "before" not in realism.as_markdown(now, {"b": then["a"]})
