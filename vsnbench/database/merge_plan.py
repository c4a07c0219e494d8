"""Other records beside this one: what of theirs is new here, what is known, and what contradicts.

Campaigns are the same by their key, episodes by their UUID. What two records both have must agree: one may have further
verdicts and events, anything else that differs is a contradiction.
"""

import heapq
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, select

from vsnbench.database.campaign_plan import PlannedTrial
from vsnbench.database.lifecycle import ACTIVE, RESULTS
from vsnbench.database.row_encoding import Row
from vsnbench.database.study_merging import StudiesPlan, plan_studies
from vsnbench.database.tables import Base, Campaign, Episode, Event, Model, Robot, Site, Trial
from vsnbench.database.whole_episodes import columns_of, difference, missing_events, read_whole
from vsnbench.errors import RecordError

IDENTITIES: tuple[tuple[type[Base], str, tuple[str, ...]], ...] = (
    (Site, "site_id", ("content",)),
    (Robot, "robot_id", ("kind", "profile", "simulated")),
    (Model, "model_id", ("name", "weights_sha256", "settings", "surveyed", "files")),
)
"""What a campaign runs on, its column there, and what its hash is of: equal hashes with other content are a lie."""


@dataclass(frozen=True, slots=True)
class OtherRecord:
    """Another record, open for reading as one snapshot."""

    name: str
    """For people."""
    connection: Connection


@dataclass(frozen=True, slots=True)
class Arrival:
    """An episode that this record does not have yet."""

    uuid: str
    other: int
    """In which of the other records, counted from 0."""
    number: int
    """Its number there."""
    started_at: datetime
    images_directory: str
    """There; empty when it has no images."""
    campaign_key: str
    trial: PlannedTrial
    is_result: bool


@dataclass(frozen=True, slots=True)
class Addition:
    """An episode that this record has, or gets from another, and of which a further one says more."""

    uuid: str
    other: int
    number: int
    """Its number there."""


@dataclass(slots=True)
class MergePlan:
    """What a merge would do."""

    arrivals: list[Arrival] = field(default_factory=list)
    """In the order in which they get their numbers."""
    additions: list[Addition] = field(default_factory=list)
    known: int = 0
    """Episodes of the others that this record has already, or that two of them share."""
    active: list[int] = field(default_factory=list)
    """For each other record, how many of its episodes have not ended: they are left where they are."""
    second_results: int = 0
    """Arrivals of trials that have a result already: the one with the lower number counts."""
    campaigns: int = 0
    """Campaigns that this record does not have yet."""
    trials: int = 0
    """Trials that it does not have planned yet."""
    events: int = 0
    """Events of campaigns that it does not have yet."""
    studies: StudiesPlan = field(default_factory=StudiesPlan)

    @property
    def changes(self) -> bool:
        """Whether it would change anything."""
        return bool(
            self.arrivals or self.additions or self.campaigns or self.trials or self.events or self.studies.united
        )


def plan_merge(mine: Connection, others: Sequence[OtherRecord], *, thorough: bool = True) -> MergePlan:
    """Compare the records, and say what a merge would do.

    Args:
        mine: this record.
        others: those that come into it.
        thorough: compare the steps of episodes that are on both sides, too.

    Raises:
        RecordError: they contradict each other.
    """
    campaigns = agreeing_campaigns(mine, others)
    plan = MergePlan(studies=plan_studies(mine, [(other.name, other.connection) for other in others]))
    plan.campaigns = sum(1 for key in campaigns if key not in campaign_numbers(mine))
    plan.trials = sum(len(trials) for trials in new_trials(mine, others, campaigns).values())
    plan.events = sum(len(events) for events in new_events(mine, others).values())
    numbers: dict[str, int] = {row.uuid: row.id for row in mine.execute(select(Episode.uuid, Episode.id))}
    arriving: dict[str, Arrival] = {}
    contradictions = []
    for place, other in enumerate(others):
        active = 0
        for arrival, ended in _episodes(other.connection, place):
            if not ended:
                active += 1
                continue
            if arrival.uuid not in numbers and arrival.uuid not in arriving:
                arriving[arrival.uuid] = arrival
                continue
            plan.known += 1
            first = arriving.get(arrival.uuid)
            here = others[first.other].connection if first else mine
            at = first.number if first else numbers[arrival.uuid]
            ours = read_whole(here, at, steps=thorough)
            theirs = read_whole(other.connection, arrival.number, steps=thorough)
            if wrong := difference(ours, theirs):
                where = f"episode {at} of {others[first.other].name}" if first else f"episode {at} here"
                contradictions.append(
                    f"{where} and episode {arrival.number} of {other.name} have one UUID ({arrival.uuid}), and {wrong}"
                )
            elif len(theirs.verdicts) > len(ours.verdicts) or missing_events(ours.events, theirs.events):
                plan.additions.append(Addition(arrival.uuid, place, arrival.number))
        plan.active.append(active)
    if contradictions:
        more = f" (and {len(contradictions) - 1} more like it)" if len(contradictions) > 1 else ""
        raise RecordError(f"{contradictions[0]}{more}", advice="nothing was written; find out which record was changed")
    by_record = [[one for one in arriving.values() if one.other == place] for place in range(len(others))]
    plan.arrivals = list(heapq.merge(*by_record, key=lambda one: one.started_at))
    plan.second_results = _second_results(mine, plan.arrivals)
    return plan


def campaign_numbers(connection: Connection) -> dict[str, int]:
    """Return the numbers of a record's campaigns by their keys."""
    return {row.key: row.id for row in connection.execute(select(Campaign.key, Campaign.id))}


def agreeing_campaigns(mine: Connection, others: Sequence[OtherRecord]) -> dict[str, tuple[Row, OtherRecord]]:
    """Return the others' campaigns by key, each as the first that has it says.

    Raises:
        RecordError: one key, or one hash of a site, robot or model, stands for two different things.
    """
    known: dict[tuple[str, str], Any] = {}
    found: dict[str, tuple[Row, OtherRecord]] = {}
    for other in (OtherRecord("this record", mine), *others):
        for table, _, names in IDENTITIES:
            for row in _all(other.connection, table):
                _agree(known, table.__tablename__, row["sha256"], [row[name] for name in names], other.name)
        for row in _all(other.connection, Campaign):
            stands_for = [row["protocol"], row["conditions"], row["seed"]]
            for table, column, _ in IDENTITIES:
                stands_for.append(_sha256(other.connection, table, row[column]))
            _agree(known, "campaign", row["key"], stands_for, other.name)
            if other.connection is not mine:
                found.setdefault(row["key"], (dict(row), other))
    return found


def _agree(known: dict[tuple[str, str], Any], kind: str, identity: str, content: Any, where: str) -> None:
    if known.setdefault((kind, identity), content) != content:
        raise RecordError(
            f"the {kind} {identity[:12]} of {where} is another than that of the same hash in the records before it",
            advice="nothing was written; one of them was changed by hand",
        )


def _all(connection: Connection, table: type[Base]) -> list[Row]:
    rows = connection.execute(select(*columns_of(table)).order_by(table.__table__.c.id)).mappings()
    return [dict(row) for row in rows]


def _sha256(connection: Connection, table: type[Base], number: int) -> str:
    columns = table.__table__.c
    return str(connection.execute(select(columns.sha256).where(columns.id == number)).scalar_one())


def new_trials(
    mine: Connection, others: Sequence[OtherRecord], campaigns: Iterable[str]
) -> dict[str, list[PlannedTrial]]:
    """Return, by campaign, what the others have planned and this record has not, in the order of their plans."""
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


def new_events(mine: Connection, others: Sequence[OtherRecord]) -> dict[str, list[Row]]:
    """Return, by campaign, the events of campaigns themselves that the others have and this record has not."""
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


def _episodes(connection: Connection, place: int) -> Iterable[tuple[Arrival, bool]]:
    """Yield the episodes of another record in the order of their numbers, and whether each has ended."""
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
        yield Arrival(uuid, place, number, started_at, directory, key, trial, state in results), state not in active


def _second_results(mine: Connection, arrivals: Iterable[Arrival]) -> int:
    rows = mine.execute(
        select(Campaign.key, Trial.goal, Trial.start, Trial.repetition)
        .join(Trial, Trial.campaign_id == Campaign.id)
        .join(Episode, Episode.trial_id == Trial.id)
        .where(Episode.state.in_([state.value for state in RESULTS]))
    )
    have = {(key, PlannedTrial(goal, start, repetition)) for key, goal, start, repetition in rows}
    second = 0
    for arrival in arrivals:
        if arrival.is_result:
            second += (arrival.campaign_key, arrival.trial) in have
            have.add((arrival.campaign_key, arrival.trial))
    return second
