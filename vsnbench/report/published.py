"""The numbers that the paper prints, as data, in the same shape as our own so that they can be laid beside them."""

import math
from functools import cache
from pathlib import Path

import yaml
from pydantic import BaseModel, ConfigDict, Field

from vsnbench.report.conditions import Condition
from vsnbench.report.summary import ConditionSummary, GoalSummary, Results, Summary
from vsnbench.statistics.clustered import Outcomes, independent_outcomes
from vsnbench.statistics.rates import Proportion


class _Data(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class PublishedStops(_Data):
    """How often a model sampled STOP (paper, Figure 9 and Section 4.5), as printed."""

    count: int
    percent: float


class PublishedModel(_Data):
    """One model's results in the real world (paper, Tables 3 to 5)."""

    name: str
    title: str
    table: int
    goals: dict[str, tuple[int, int, float]]
    """Goal -> successes, episodes, average number of actions over all episodes."""
    virtual_success_percent: float
    """In the simulator of the model's own paper (Table 3); how many episodes is not said."""
    never_succeeding_starts: tuple[int, ...] = ()
    once_succeeding_starts: tuple[int, ...] = ()
    stops: PublishedStops | None = None


class PublishedStability(_Data):
    """How long and how far one robot drove (paper, Table 6)."""

    robot: str
    hours: float = Field(gt=0)
    kilometres: float = Field(gt=0)


class Published(_Data):
    """Everything that the paper prints."""

    source: str
    site: str
    robot: str
    max_actions: int
    success_distance_m: float
    models: tuple[PublishedModel, ...]
    stability: tuple[PublishedStability, ...]

    @property
    def hours(self) -> float:
        """Hours of all robots."""
        return sum(one.hours for one in self.stability)

    @property
    def kilometres(self) -> float:
        """Kilometres of all robots; rounded as each of them is."""
        return round(sum(one.kilometres for one in self.stability), 2)

    def model(self, name: str) -> PublishedModel | None:
        """Return the published model of that name; None when the paper has no such model."""
        return next((one for one in self.models if one.name == name.lower()), None)


@cache
def published() -> Published:
    """Return the paper's numbers."""
    text = Path(__file__).with_name("published.yaml").read_text(encoding="utf-8")
    return Published.model_validate(yaml.safe_load(text))


def published_results() -> Results:
    """Return the paper's Tables 4 and 5 as results; what it does not say is NaN or None."""
    paper = published()
    goals = [set(model.goals) for model in paper.models]
    shared = tuple(goal for goal in paper.models[0].goals if all(goal in each for each in goals))
    return Results(
        tuple(_condition(paper, model, shared, place) for place, model in enumerate(paper.models, start=1)),
    )


def _condition(paper: Published, model: PublishedModel, shared: tuple[str, ...], place: int) -> ConditionSummary:
    condition = Condition(
        number=-place,  # never one of the record's
        model=model.name,
        weights_label="",
        weights_sha256="",
        surveyed=False,
        robot=paper.robot,
        robot_title=paper.robot,
        kind="paper",
        simulated=False,
        site=paper.site,
        site_sha256="",
        campaigns=(),
        protocol={"max_actions": paper.max_actions, "success_distance_m": paper.success_distance_m},
        name=f"{model.title} (paper)",
        published=True,
    )
    # No two goals' trials are taken for ones from the same position.
    summaries = {goal: _summary(*numbers, -1000 * place) for place, (goal, numbers) in enumerate(model.goals.items())}
    return ConditionSummary(
        condition=condition,
        goals=tuple(GoalSummary(goal, summary) for goal, summary in summaries.items()),
        total=_sum([*summaries.values()]),
        shared=_sum([summaries[goal] for goal in shared]),
        starts=(),
        ends=(),
        shared_goals=shared,
    )


def _summary(
    successes: int, episodes: int, mean_actions: float, after: int = 0, outcomes: Outcomes | None = None
) -> Summary:
    return Summary(
        successes=successes,
        episodes=episodes,
        planned=episodes,
        void=None,
        unjudged=0,
        mean_actions=mean_actions,
        mean_actions_successful=math.nan,
        spl=math.nan,
        soft_spl=math.nan,
        spl_episodes=0,
        soft_spl_episodes=0,
        median_distance_m=math.nan,
        collisions=None,
        step_limits=None,
        trivial=None,
        # The paper does not say which trials succeeded: each is taken for one of its own.
        outcomes=outcomes or independent_outcomes(Proportion(successes, episodes), after),
    )


def _sum(goals: list[Summary]) -> Summary:
    # The paper prints no average of actions over the goals; none is made up here.
    outcomes = Outcomes(tuple(cell for one in goals for cell in one.outcomes.cells))
    return _summary(
        sum(one.successes for one in goals), sum(one.episodes for one in goals), math.nan, outcomes=outcomes
    )
