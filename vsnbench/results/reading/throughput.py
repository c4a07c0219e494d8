"""Throughput of a record and progress of sweeps, to estimate the remaining time."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from sqlalchemy import Engine, func, select

from vsnbench.protocol.disturbances import text_of_conditions
from vsnbench.results.reading.read_model import episodes_of_campaigns
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, ModelRow, SiteRow, TrialRow
from vsnbench.results.writing.lifecycle import RESULTS


@dataclass(frozen=True, slots=True)
class Throughput:
    """Recorded durations and progress."""

    seconds: Mapping[str, tuple[float, int]]
    """By model: mean wall time of an episode, and number of episodes."""
    done: Mapping[tuple[str, str, int, str, str, str], int]
    """By model, site, seed, text of the disturbances, hash of the protocol and goal: number of trials with a result."""


NO_THROUGHPUT = Throughput({}, {})


def throughput_of(engine: Engine) -> Throughput:
    """Read the recorded durations and progress.

    Raises:
        RecordError: the database cannot be read.
    """
    results = EpisodeRow.state.in_([state.value for state in RESULTS])
    seconds = (
        episodes_of_campaigns(
            ModelRow.name, func.avg(EpisodeRow.wall_duration_s), func.count(EpisodeRow.wall_duration_s)
        )
        .where(results, EpisodeRow.wall_duration_s > 0)
        .group_by(ModelRow.name)
    )
    trials = (
        episodes_of_campaigns(
            CampaignRow.id, ModelRow.name, SiteRow.name, TrialRow.goal, func.count(EpisodeRow.trial_id.distinct())
        )
        .where(results)
        .group_by(CampaignRow.id, ModelRow.name, SiteRow.name, TrialRow.goal)
    )
    with transaction(reading(engine)) as connection:
        campaigns = {
            row.id: (row.seed, text_of_conditions(row.conditions), row.protocol_sha256)
            for row in connection.execute(
                select(CampaignRow.id, CampaignRow.seed, CampaignRow.conditions, CampaignRow.protocol_sha256)
            )
        }
        done: Counter[tuple[str, str, int, str, str, str]] = Counter()
        for campaign, model, site, goal, count in connection.execute(trials):
            done[model, site, *campaigns[campaign], goal] += count
        return Throughput({name: (float(mean), count) for name, mean, count in connection.execute(seconds)}, done)
