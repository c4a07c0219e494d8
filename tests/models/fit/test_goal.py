"""Which goals fit a model, and what its policy receives."""

from pathlib import Path

import pytest

from tests.sites.goal_sites import GOALS, write_site
from vsnbench.errors import UsageError
from vsnbench.models.contract import ModelCard
from vsnbench.models.fit.goal import goal_for, misfit
from vsnbench.runner.setup.selection import choose_goals
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


def test_a_sequence_fits_a_model_that_takes_each_of_its_goals(tmp_path: Path) -> None:
    tour = GOALS + "  - {id: tour, kind: sequence, goals: [sofa, red-armchair]}\n"
    site = load_site(write_site(tmp_path, tour))
    assert not misfit(TEXT, site, "tour")
    assert misfit(COCO, site, "tour") == (
        "sequence tour: model coco takes goals of kind category, and red-armchair is of kind text"
    )
    with pytest.raises(UsageError) as refused:
        choose_goals(["tour"], site, COCO)
    assert refused.value.code == "goal-kind"
