"""How fast a record's trials were run, and how many of a sweep are done: from which it is said what the rest costs."""

from collections.abc import Mapping
from dataclasses import dataclass

from sqlalchemy import Engine, func

from vsnbench.database.engine import reading, record_errors
from vsnbench.database.lifecycle import RESULTS
from vsnbench.database.read_model import episodes_of_campaigns
from vsnbench.database.tables import Campaign, Episode, Model, Site


@dataclass(frozen=True, slots=True)
class Pace:
    """What a record says of the time that its trials took."""

    seconds: Mapping[str, tuple[float, int]]
    """By model: wall time of an episode, on average, and of how many."""
    done: Mapping[tuple[str, str, int], int]
    """By model, site and seed: how many trials have a result."""


NO_PACE = Pace({}, {})


def pace_of(engine: Engine) -> Pace:
    """Read what a record says of the time that its trials took.

    Raises:
        RecordError: the database cannot be read.
    """
    results = Episode.state.in_([state.value for state in RESULTS])
    seconds = (
        episodes_of_campaigns(Model.name, func.avg(Episode.wall_duration_s), func.count(Episode.wall_duration_s))
        .where(results, Episode.wall_duration_s > 0)
        .group_by(Model.name)
    )
    done = (
        episodes_of_campaigns(Model.name, Site.name, Campaign.seed, func.count(Episode.trial_id.distinct()))
        .where(results)
        .group_by(Model.name, Site.name, Campaign.seed)
    )
    with record_errors(engine), reading(engine).begin() as connection:
        return Pace(
            {name: (float(mean), count) for name, mean, count in connection.execute(seconds)},
            {(model, site, seed): count for model, site, seed, count in connection.execute(done)},
        )
