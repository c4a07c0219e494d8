"""The paper's results as data, in the same types as recorded results."""

from functools import cache
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.summary import ConditionSummary, Group, ReportResults, sum_of
from vsnbench.settings.yaml_text import load_yaml
from vsnbench.statistics.clustered import independent_outcomes
from vsnbench.statistics.rates import Proportion
from vsnbench.values.goal import GoalKind

PAPER_INTERVALS = (
    "The paper does not print which trials succeeded: its intervals are Wilson's and its tests Fisher's, for "
    "independent trials. All its trials start from the same 15 positions, so over several goals the true intervals are "
    "probably wider and the p-values larger."
)


class _Data(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class PublishedStops(_Data):
    """How often a model sampled STOP (paper, Figure 9 and Section 4.5)."""

    count: int
    percent: float


class PublishedModel(_Data):
    """Results of one model on the real robot (paper, Tables 3 to 5)."""

    name: str
    title: str
    table: int
    goals: dict[str, tuple[int, int, float]]
    """Goal -> successes, episodes, average number of actions over all episodes."""
    virtual_success_percent: float
    """Success in the simulator of the model's own paper (Table 3); the number of episodes is not stated."""
    never_succeeding_starts: tuple[int, ...] = ()
    once_succeeding_starts: tuple[int, ...] = ()
    stops: PublishedStops | None = None


class PublishedStability(_Data):
    """Driving time and distance of one robot (paper, Table 6)."""

    robot: str
    hours: float = Field(gt=0)
    kilometres: float = Field(gt=0)


class Published(_Data):
    """All published results."""

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
        return sum(robot.hours for robot in self.stability)

    @property
    def kilometres(self) -> float:
        """Kilometres of all robots, rounded like the published values."""
        return round(sum(robot.kilometres for robot in self.stability), 2)


@cache
def published() -> Published:
    """Return the paper's results."""
    text = Path(__file__).with_name("published.yaml").read_text(encoding="utf-8")
    return Published.model_validate(load_yaml(text))


def published_results() -> ReportResults:
    """Return the paper's Tables 4 and 5 as results; missing values are NaN or None."""
    paper = published()
    goals = [set(model.goals) for model in paper.models]
    shared = tuple(goal for goal in paper.models[0].goals if all(goal in reported for reported in goals))
    return ReportResults(
        tuple(_condition(paper, model, shared, place) for place, model in enumerate(paper.models, start=1)),
    )


def _condition(paper: Published, model: PublishedModel, shared: tuple[str, ...], place: int) -> ConditionSummary:
    condition = Condition(
        number=-place,  # negative, to differ from recorded conditions
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
    groups = {}
    for number, (goal, (successes, episodes, mean_actions)) in enumerate(model.goals.items()):
        # The paper does not state which trials succeeded: each is a cluster of its own, also across goals.
        outcomes = independent_outcomes(Proportion(successes, episodes), -1000 * number)
        groups[goal] = Group(outcomes, episodes, goal=goal, kind=GoalKind.CATEGORY, published_actions=mean_actions)
    return ConditionSummary(
        condition=condition,
        goals=tuple(groups.values()),
        total=sum_of(groups.values()),
        shared=sum_of(groups[goal] for goal in shared),
        shared_goals=shared,
    )
