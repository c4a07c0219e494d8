"""Which goals a model can take, and the goal that its policy receives."""

from vsnbench.models.contract import ModelCard
from vsnbench.sites.categories import canonical_category
from vsnbench.sites.site import Site
from vsnbench.sites.targets import describe_goal, kind_of, legs_of
from vsnbench.values.goal import Goal, GoalKind
from vsnbench.values.pose import Pose


def word_for(card: ModelCard, category: str) -> str:
    """Return the model's own word for a category: `potted plant` for `plant`; empty if it does not know it."""
    if card.goals is None or category in card.goals:
        return category
    return min((word for word in card.goals if canonical_category(word) == category), default="")


def misfit(card: ModelCard, site: Site, name: str) -> str:
    """Return why a model cannot take a goal of a site, and what would fit; empty if it can take it.

    A model takes a sequence if it takes each of its goals. `sequence` on its card only says that it keeps its memory.
    """
    kind = kind_of(site, name)
    if kind is GoalKind.SEQUENCE:
        found = (misfit(card, site, leg) for leg in legs_of(site, name))
        problem = next(filter(None, found), "")
        return problem and f"sequence {name}: {problem}"
    kinds = card.goal_kinds
    as_words = kind is GoalKind.CATEGORY and kind not in kinds and GoalKind.TEXT in kinds
    if kind not in kinds and not as_words:
        takes = " or ".join(sorted(kinds))
        return f"model {card.name} takes goals of kind {takes}, and {name} is of kind {kind}"
    if kind is GoalKind.CATEGORY and not as_words and not word_for(card, _category_of(site, name)):
        return f"model {card.name} does not know {name}; it knows {', '.join(sorted(card.goals or ()))}"
    return ""


def goal_for(card: ModelCard, site: Site, name: str, start: Pose) -> Goal:
    """Return a goal of a site as the policy with this card receives it, in an episode that began at a pose.

    A model of text goals receives the words of a category, and a model with another name for a category that name.
    Nothing else is converted.

    Raises:
        SiteError: the photograph of an image goal is not available (`no-goal-image`).
    """
    goal = describe_goal(site, name, start)
    if goal.kind is not GoalKind.CATEGORY:
        return goal
    if GoalKind.CATEGORY not in card.goal_kinds and GoalKind.TEXT in card.goal_kinds:
        return Goal(goal.id, GoalKind.TEXT, text=goal.text, category=goal.category)
    word = word_for(card, goal.category)
    return Goal(goal.id, category=word) if word and word != goal.category else goal


def _category_of(site: Site, name: str) -> str:
    goal = site.goal(name)
    return name if goal is None else canonical_category(goal.category)
