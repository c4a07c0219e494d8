"""Throughput of a record and progress of sweeps, to estimate the remaining time."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from sqlalchemy import Engine, func, select

from vsnbench.protocol.disturbances import text_of_conditions
from vsnbench.results.reading.read_model import episodes_of_campaigns
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.schema.tables import Campaign, Episode, Model, Site
from vsnbench.results.writing.lifecycle import RESULTS


@dataclass(frozen=True, slots=True)
class Throughput:
    """Recorded durations and progress."""

    seconds: Mapping[str, tuple[float, int]]
    """By model: mean wall time of an episode, and number of episodes."""
    done: Mapping[tuple[str, str, int, str], int]
    """By model, site, seed and text of the disturbances: number of trials with a result."""


NO_THROUGHPUT = Throughput({}, {})


def throughput_of(engine: Engine) -> Throughput:
    """Read the recorded durations and progress.

    Raises:
        RecordError: the database cannot be read.
    """
    results = Episode.state.in_([state.value for state in RESULTS])
    seconds = (
        episodes_of_campaigns(Model.name, func.avg(Episode.wall_duration_s), func.count(Episode.wall_duration_s))
        .where(results, Episode.wall_duration_s > 0)
        .group_by(Model.name)
    )
    trials = (
        episodes_of_campaigns(Campaign.id, Model.name, Site.name, func.count(Episode.trial_id.distinct()))
        .where(results)
        .group_by(Campaign.id, Model.name, Site.name)
    )
    with transaction(reading(engine)) as connection:
        campaigns = {
            row.id: (row.seed, text_of_conditions(row.conditions))
            for row in connection.execute(select(Campaign.id, Campaign.seed, Campaign.conditions))
        }
        done: Counter[tuple[str, str, int, str]] = Counter()
        for campaign, model, site, count in connection.execute(trials):
            seed, disturbed = campaigns[campaign]
            done[model, site, seed, disturbed] += count
        return Throughput({name: (float(mean), count) for name, mean, count in connection.execute(seconds)}, done)
