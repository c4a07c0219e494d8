"""Which goals fit a model, and what its policy receives."""

from pathlib import Path

import pytest

from tests.sites.goal_sites import write_site
from vsnbench.models.contract import ModelCard
from vsnbench.models.fit.goal import goal_for, misfit
from vsnbench.sites.site import Site, load_site
from vsnbench.values.goal import GoalKind
from vsnbench.values.pose import Pose

TEXT = ModelCard("reader", goal_kinds=frozenset({GoalKind.TEXT}))
COCO = ModelCard("coco", goals=frozenset({"potted plant", "couch"}))


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return load_site(write_site(tmp_path))


def test_a_text_model_receives_a_category_as_words_and_nothing_else_is_converted(site: Site) -> None:
    goal = goal_for(TEXT, site, "washing_machine", Pose(0.0, 0.0))
    assert (goal, goal.kind, goal.id) == ("washing machine", GoalKind.TEXT, "washing_machine")
    assert not misfit(TEXT, site, "cold-box")
    assert not misfit(TEXT, site, "red-armchair")
    assert misfit(TEXT, site, "photo-bed")
    assert misfit(TEXT, site, "to-the-kitchen")


def test_a_model_receives_its_own_word_for_a_category(site: Site) -> None:
    assert goal_for(COCO, site, "plant", Pose(0.0, 0.0)) == "potted plant"
    assert not misfit(COCO, site, "sofa")
    assert misfit(COCO, site, "bed")
    assert misfit(COCO, site, "red-armchair")
