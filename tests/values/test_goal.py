"""The goal that a policy receives."""

import pickle

import numpy as np
import pytest

from vsnbench import Goal, GoalKind


def test_a_category_goal_behaves_as_its_word() -> None:
    goal = Goal("potted-plant-3", category="washing_machine")
    assert goal == "washing_machine"
    assert {"washing_machine": 1}[goal] == 1
    assert (goal.id, goal.kind, goal.text) == ("potted-plant-3", GoalKind.CATEGORY, "washing machine")


def test_a_text_goal_is_its_text_and_an_image_goal_its_id() -> None:
    assert Goal("a", GoalKind.TEXT, text="the red chair") == "the red chair"
    photo = Goal("b", GoalKind.IMAGE, image=np.zeros((2, 3, 3), np.uint8))
    assert photo == "b"
    assert photo.image is not None
    with pytest.raises(ValueError, match="read-only"):
        photo.image[0, 0, 0] = 1


def test_a_goal_survives_another_process_and_cannot_be_changed() -> None:
    goal = pickle.loads(pickle.dumps(Goal("a", GoalKind.INSTRUCTION, text="turn left")))
    assert (goal, goal.id, goal.kind) == ("turn left", "a", GoalKind.INSTRUCTION)
    with pytest.raises(AttributeError):
        goal.text = "turn right"


@pytest.mark.parametrize("kind", [GoalKind.TEXT, GoalKind.IMAGE, GoalKind.INSTRUCTION])
def test_a_goal_without_what_describes_it_is_refused(kind: GoalKind) -> None:
    with pytest.raises(ValueError, match="needs"):
        Goal("a", kind)
