"""Definitions of goals in a merge: compared between records, and copied with the trials that refer to them."""

from collections.abc import Iterable, Sequence

from sqlalchemy import Connection, select

from vsnbench.errors import RecordError
from vsnbench.results.merging.episodes import OtherRecord
from vsnbench.results.schema.row_encoding import Row, find_or_insert
from vsnbench.results.schema.tables import CampaignRow, GoalRow, TrialRow

Definitions = dict[tuple[str, str], Row | None]
"""(Key of the campaign, name of the goal) -> row of the definition; None for a category."""


def definitions_of_trials(connection: Connection) -> Definitions:
    """Return the definitions of the goals of a record's trials."""
    rows = connection.execute(
        select(
            CampaignRow.key, TrialRow.goal, GoalRow.sha256, GoalRow.name, GoalRow.kind, GoalRow.content, GoalRow.image
        )
        .join(CampaignRow, CampaignRow.id == TrialRow.campaign_id)
        .join(GoalRow, GoalRow.id == TrialRow.goal_id)
    )
    names = ("sha256", "name", "kind", "content", "image")
    return {(row["key"], row["goal"]): {name: row[name] for name in names} for row in rows.mappings()}


def agreeing_definitions(records: Iterable[OtherRecord]) -> Definitions:
    """Return the definitions of the goals of all records.

    Raises:
        RecordError: trials of one campaign have goals of one name with different definitions (`goal-changed`).
    """
    defined_in = [(record, definitions_of_trials(record.connection)) for record in records]
    if not any(defined for _, defined in defined_in):
        return {}
    known: Definitions = {}
    pairs = select(CampaignRow.key, TrialRow.goal).join(CampaignRow, CampaignRow.id == TrialRow.campaign_id).distinct()
    for record, defined in defined_in:
        for key, goal in record.connection.execute(pairs):
            mine = defined.get((key, goal))
            before = known.setdefault((key, goal), mine)
            if before != mine:
                raise RecordError(
                    f"goal {goal!r} of campaign {key[:12]} in {record.name} has another definition than in another "
                    "record",
                    advice="nothing was written; trials of different goals cannot be merged under one name",
                    code="goal-changed",
                )
    return known


def take_definitions(mine: Connection, key: str, goals: Sequence[str], definitions: Definitions) -> dict[str, int]:
    """Store the definitions of the goals of a campaign, and return their numbers in this record by name."""
    wanted = ((goal, definitions.get((key, goal))) for goal in dict.fromkeys(goals))
    return {goal: find_or_insert(mine, GoalRow, row, "sha256") for goal, row in wanted if row is not None}
