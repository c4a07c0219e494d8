"""Plans a merge: new, known and contradicting data of other records.

Campaigns are identified by their key, episodes by their UUID. Data in several records must agree, except that one may
have further verdicts and events.
"""

import heapq
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, select

from vsnbench.errors import RecordError
from vsnbench.results.merging.episodes import OtherRecord, columns_of, difference, missing_events, read_episode_rows
from vsnbench.results.merging.goals import Definitions, agreeing_definitions
from vsnbench.results.merging.studies import StudiesPlan, plan_studies
from vsnbench.results.schema.base import Base
from vsnbench.results.schema.row_encoding import Row
from vsnbench.results.schema.tables import Campaign, Episode, Event, Model, Robot, Site, Trial
from vsnbench.results.writing.campaigns import Trial as PlannedTrial
from vsnbench.results.writing.lifecycle import ACTIVE, RESULTS

IDENTITIES: tuple[tuple[type[Base], str, tuple[str, ...]], ...] = (
    (Site, "site_id", ("content",)),
    (Robot, "robot_id", ("kind", "profile", "simulated")),
    (Model, "model_id", ("name", "weights_sha256", "settings", "surveyed", "files")),
)
"""Tables that a campaign refers to, with the column and the hashed fields; equal hashes require equal content."""


@dataclass(frozen=True, slots=True)
class OtherEpisode:
    """An episode of another record."""

    uuid: str
    other: int
    """Index of the other record."""
    number: int
    """Its number in that record."""
    started_at: datetime
    images_directory: str
    """In that record; empty without images."""
    campaign_key: str
    trial: PlannedTrial
    is_result: bool


@dataclass(frozen=True, slots=True)
class ExistingEpisode:
    """An episode that this record has."""

    number: int
    images_directory: str
    """Empty without images in this record."""


@dataclass(slots=True)
class MergePlan:
    """Effects of a merge."""

    definitions: Definitions
    """Definitions of the goals of all records."""
    new_campaigns: Mapping[str, tuple[Row, OtherRecord]]
    """Key -> campaign, in the first record that has it."""
    new_trials: Mapping[str, Sequence[PlannedTrial]]
    """Key of a campaign -> further planned trials."""
    new_events: Mapping[str, Sequence[Row]]
    """Key of a campaign -> further events of the campaign."""
    studies: StudiesPlan
    new_episodes: list[OtherEpisode] = field(default_factory=list)
    """In the order of their new numbers."""
    updates: list[OtherEpisode] = field(default_factory=list)
    """Episodes of which another record has further verdicts or events."""
    copies: dict[str, list[OtherEpisode]] = field(default_factory=dict)
    """UUID -> copies of the episode in further records."""
    present: dict[str, ExistingEpisode] = field(default_factory=dict)
    """UUID -> the episode in this record, for each copy that it has."""
    known: int = 0
    """Number of copies of episodes that this record or an earlier one has."""
    active: list[int] = field(default_factory=list)
    """Number of episodes of each other record that have not ended and are not merged."""
    second_results: int = 0
    """Number of new episodes of trials that already have a result; the lowest number counts."""

    @property
    def changes(self) -> bool:
        """Whether the merge changes anything."""
        rows = self.new_campaigns or self.new_trials or self.new_events
        return bool(rows or self.studies.united or self.new_episodes or self.updates)


def plan_merge(mine: Connection, others: Sequence[OtherRecord], *, thorough: bool = True) -> MergePlan:
    """Compare the records and return the effects of a merge into `mine`.

    If `thorough`, the steps of episodes in several records are compared as well.

    Raises:
        RecordError: they contradict each other.
    """
    records = [OtherRecord("this record", mine), *others]
    campaigns = _agreeing_campaigns(records)
    known_keys = campaign_numbers(mine)
    plan = MergePlan(
        agreeing_definitions(records),
        {key: found for key, found in campaigns.items() if key not in known_keys},
        _new_trials(mine, others, campaigns),
        _new_events(mine, others),
        plan_studies(records),
    )
    here = {
        row.uuid: ExistingEpisode(row.id, row.images_directory)
        for row in mine.execute(select(Episode.uuid, Episode.id, Episode.images_directory))
    }
    arriving: dict[str, OtherEpisode] = {}
    contradictions = []
    for place, other in enumerate(others):
        active = 0
        for episode, ended in _episodes(other.connection, place):
            uuid = episode.uuid
            if not ended:
                active += 1
                continue
            if uuid not in here and uuid not in arriving:
                arriving[uuid] = episode
                continue
            plan.known += 1
            plan.copies.setdefault(uuid, []).append(episode)
            first = arriving.get(uuid)
            if first is None:
                plan.present[uuid] = here[uuid]
            at = first.number if first else here[uuid].number
            ours = read_episode_rows(others[first.other].connection if first else mine, at, steps=thorough)
            theirs = read_episode_rows(other.connection, episode.number, steps=thorough)
            if wrong := difference(ours, theirs):
                where = f"episode {at} of {others[first.other].name}" if first else f"episode {at} here"
                contradictions.append(
                    f"{where} and episode {episode.number} of {other.name} have the same UUID ({uuid}), and {wrong}"
                )
            elif len(theirs.verdicts) > len(ours.verdicts) or missing_events(ours.events, theirs.events):
                plan.updates.append(episode)
        plan.active.append(active)
    if contradictions:
        more = f" (and {len(contradictions) - 1} more like it)" if len(contradictions) > 1 else ""
        raise RecordError(f"{contradictions[0]}{more}", advice="nothing was written; check which record was changed")
    by_record = [[episode for episode in arriving.values() if episode.other == place] for place in range(len(others))]
    plan.new_episodes = list(heapq.merge(*by_record, key=lambda episode: episode.started_at))
    plan.second_results = _second_results(mine, plan.new_episodes)
    return plan


def campaign_numbers(connection: Connection) -> dict[str, int]:
    """Return the numbers of a record's campaigns by key."""
    return {row.key: row.id for row in connection.execute(select(Campaign.key, Campaign.id))}


def _agreeing_campaigns(records: Sequence[OtherRecord]) -> dict[str, tuple[Row, OtherRecord]]:
    """Return the campaigns of all records but the first by key, each from the first of these that has it.

    Campaigns, sites, robots and models with equal hashes must have equal contents.
    """
    known: dict[tuple[str, str], Any] = {}
    found: dict[str, tuple[Row, OtherRecord]] = {}
    for place, record in enumerate(records):
        hashes: dict[tuple[str, int], str] = {}
        for table, column, names in IDENTITIES:
            for row in _all(record.connection, table):
                hashes[column, row["id"]] = row["sha256"]
                _agree(known, table.__tablename__, row["sha256"], [row[name] for name in names], record.name)
        for row in _all(record.connection, Campaign):
            condition = [row["protocol"], row["conditions"], row["seed"]]
            condition += [hashes[column, row[column]] for _, column, _ in IDENTITIES]
            _agree(known, "campaign", row["key"], condition, record.name)
            if place > 0:
                found.setdefault(row["key"], (row, record))
    return found


def _agree(known: dict[tuple[str, str], Any], kind: str, identity: str, content: Any, where: str) -> None:
    if known.setdefault((kind, identity), content) != content:
        raise RecordError(
            f"the {kind} {identity[:12]} of {where} differs from that of the same hash in another record",
            advice="nothing was written; one of the records was edited by hand",
        )


def _all(connection: Connection, table: type[Base]) -> list[Row]:
    rows = connection.execute(select(*columns_of(table)).order_by(table.__table__.c.id)).mappings()
    return [dict(row) for row in rows]


def _new_trials(
    mine: Connection, others: Sequence[OtherRecord], campaigns: Iterable[str]
) -> dict[str, list[PlannedTrial]]:
    """Return, by campaign, the planned trials that this record lacks, in the order of the others' plans."""
    have = {key: set(trials) for key, trials in _trials(mine).items()}
    ranked: dict[str, dict[PlannedTrial, int]] = {key: {} for key in campaigns}
    for other in others:
        for key, trials in _trials(other.connection).items():
            for trial, rank in trials.items():
                if trial not in have.get(key, ()):
                    ranked[key].setdefault(trial, rank)
    return {key: sorted(trials, key=trials.__getitem__) for key, trials in ranked.items() if trials}


def _trials(connection: Connection) -> dict[str, dict[PlannedTrial, int]]:
    rows = connection.execute(
        select(Campaign.key, Trial.goal, Trial.start, Trial.repetition, Trial.rank)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .order_by(Trial.campaign_id, Trial.rank, Trial.id)
    )
    found: dict[str, dict[PlannedTrial, int]] = {}
    for key, goal, start, repetition, rank in rows:
        found.setdefault(key, {})[PlannedTrial(goal, start, repetition)] = rank
    return found


def _new_events(mine: Connection, others: Sequence[OtherRecord]) -> dict[str, list[Row]]:
    """Return, by campaign, the campaign events that this record lacks."""
    new: dict[str, list[Row]] = {}
    have = _campaign_events(mine)
    for other in others:
        for key, events in _campaign_events(other.connection).items():
            known = have.setdefault(key, [])
            if missing := missing_events(known, events):
                known.extend(missing)
                new.setdefault(key, []).extend(missing)
    return new


def _campaign_events(connection: Connection) -> dict[str, list[Row]]:
    columns = columns_of(Event, "id", "campaign_id", "episode_id")
    rows = connection.execute(
        select(Campaign.key, *columns)
        .join(Campaign, Campaign.id == Event.campaign_id)
        .where(Event.episode_id.is_(None))
        .order_by(Event.id)
    )
    found: dict[str, list[Row]] = {}
    for row in rows.mappings():
        found.setdefault(row["key"], []).append({column.name: row[column.name] for column in columns})
    return found


def _episodes(connection: Connection, place: int) -> Iterable[tuple[OtherEpisode, bool]]:
    """Yield the episodes of another record by number, and whether each has ended."""
    active, results = [state.value for state in ACTIVE], [state.value for state in RESULTS]
    rows = connection.execute(
        select(
            *(Episode.uuid, Episode.id, Episode.started_at, Episode.images_directory, Episode.state),
            *(Campaign.key, Trial.goal, Trial.start, Trial.repetition),
        )
        .join(Trial, Trial.id == Episode.trial_id)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .order_by(Episode.id)
    )
    for uuid, number, started_at, directory, state, key, goal, start, repetition in rows.all():
        trial = PlannedTrial(goal, start, repetition)
        episode = OtherEpisode(uuid, place, number, started_at, directory, key, trial, state in results)
        yield episode, state not in active


def _second_results(mine: Connection, new_episodes: Iterable[OtherEpisode]) -> int:
    rows = mine.execute(
        select(Campaign.key, Trial.goal, Trial.start, Trial.repetition)
        .join(Trial, Trial.campaign_id == Campaign.id)
        .join(Episode, Episode.trial_id == Trial.id)
        .where(Episode.state.in_([state.value for state in RESULTS]))
    )
    have = {(key, PlannedTrial(goal, start, repetition)) for key, goal, start, repetition in rows}
    second = 0
    for new_episode in new_episodes:
        if new_episode.is_result:
            second += (new_episode.campaign_key, new_episode.trial) in have
            have.add((new_episode.campaign_key, new_episode.trial))
    return second
