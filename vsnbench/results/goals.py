"""Definitions of goals in the record: written with the trials, and read with the site that they belong to."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, select

from vsnbench.errors import RecordError, UsageError
from vsnbench.results.fields import quantity
from vsnbench.results.schema.row_encoding import find_or_insert
from vsnbench.results.schema.tables import CampaignRow, GoalRow, SiteRow, TrialRow
from vsnbench.values.goal import GoalKind

if TYPE_CHECKING:
    from vsnbench.sites.goals import SiteGoal


GOAL_KINDS = ", ".join(f"`{kind}`" for kind in GoalKind)
"""Kinds of goals, in words."""


@dataclass(frozen=True, slots=True)
class RecordedGoal:
    """Definition of a goal in the record."""

    name: str = quantity("name of the goal")
    kind: GoalKind = quantity(GOAL_KINDS)
    sha256: str = quantity("SHA-256 of the definition")
    content: Mapping[str, Any] = quantity("entry of the site file; keys depend on the kind")

    @property
    def text(self) -> str:
        """The words of a text goal, an instruction or a category; else empty."""
        return goal_text(self.content)

    @property
    def target_text(self) -> str:
        """What counts as reached, in short."""
        legs = self.content.get("goals", ())
        names = (str(leg["id"] if isinstance(leg, Mapping) else leg) for leg in legs)
        return ", ".join((*names, *(_target_text(target) for target in self.content.get("targets", ()))))


def goal_text(content: Mapping[str, Any]) -> str:
    """Return the words of a recorded definition; empty for other kinds."""
    return str(content.get("text") or content.get("category") or "")


def _target_text(target: Mapping[str, Any]) -> str:
    name = str(target.get("name", ""))
    if "point" in target:
        x_m, y_m = target["point"]
        return f"point {name or f'({x_m:g}, {y_m:g})'}"
    if "region" in target:
        return f"region {name}".rstrip()
    return str(target.get("object") or f"every {target.get('category')}")


def store_goals(
    connection: Connection, campaign_id: int, goals: "Iterable[SiteGoal]", names: Collection[str]
) -> dict[str, int]:
    """Store those of a site's goals that trials name, and return their numbers by name.

    Raises:
        UsageError: the campaign has trials of a goal with the same name and another definition (`goal-changed`).
    """
    recorded = goals_of_campaign(connection, campaign_id)
    numbers = {}
    for goal in goals:
        if goal.id not in names:
            continue
        before = recorded.get(goal.id)
        if goal.id in recorded and (before is None or before.sha256 != goal.sha256):
            raise UsageError(
                f"goal {goal.id!r} has another definition than in the recorded trials of this campaign",
                advice="give the changed goal another id, so that its trials are not mixed with the others",
                code="goal-changed",
            )
        row = {"sha256": goal.sha256, "name": goal.id, "kind": goal.kind.value, "content": goal.content()}
        image = None if goal.image is None else goal.image.data
        numbers[goal.id] = find_or_insert(connection, GoalRow, {**row, "image": image}, "sha256")
    for name in names:
        if name not in numbers and recorded.get(name) is not None:
            raise UsageError(
                f"goal {name!r} is a category now, and had a definition in the recorded trials of this campaign",
                advice="restore the goal in the site file, or give the category another name",
                code="goal-changed",
            )
    return numbers


def goals_of_campaign(connection: Connection, campaign_id: int) -> dict[str, RecordedGoal | None]:
    """Return the goals of a campaign's trials by name; None for a category."""
    rows = connection.execute(
        select(TrialRow.goal, GoalRow.kind, GoalRow.sha256, GoalRow.content)
        .outerjoin(GoalRow, GoalRow.id == TrialRow.goal_id)
        .where(TrialRow.campaign_id == campaign_id)
        .distinct()
    )
    return {
        name: None if kind is None else RecordedGoal(name, GoalKind(kind), sha256, content)
        for name, kind, sha256, content in rows
    }


def goal_of_trial(connection: Connection, trial_id: int) -> RecordedGoal | None:
    """Return the definition of a trial's goal; None for a category.

    Raises:
        RecordError: the definition is invalid.
    """
    query = select(GoalRow.name, GoalRow.kind, GoalRow.sha256, GoalRow.content)
    row = connection.execute(
        query.join(TrialRow, TrialRow.goal_id == GoalRow.id).where(TrialRow.id == trial_id)
    ).first()
    if row is None:
        return None
    try:
        found = RecordedGoal(row.name, GoalKind(row.kind), row.sha256, row.content)
        _ = found.text, found.target_text
    except (AttributeError, TypeError, ValueError) as error:
        raise RecordError(f"the definition of goal {str(row.name)[:40]!r} in the record is invalid") from error
    return found


def with_goals(connection: Connection, content: dict[str, Any], campaigns: Sequence[int]) -> dict[str, Any]:
    """Return the content of a site with the goals of campaigns there, so that it reads as the site of their trials."""
    rows = connection.execute(
        select(GoalRow.name, GoalRow.content)
        .where(GoalRow.id.in_(select(TrialRow.goal_id).where(TrialRow.campaign_id.in_(list(campaigns)))))
        .order_by(GoalRow.id)
    )
    goals = {row.name: row.content for row in rows}
    if not goals or not isinstance(content, Mapping):  # a record of unknown origin may hold anything
        return content
    return {**content, "goals": list(goals.values())}


def site_contents(connection: Connection, campaigns: Iterable[int]) -> dict[str, dict[str, Any]]:
    """Return the contents of the sites of campaigns with the goals there, by hash of the site."""
    campaigns_at: dict[int, list[int]] = {}
    for campaign, site in connection.execute(select(CampaignRow.id, CampaignRow.site_id)):
        campaigns_at.setdefault(site, []).append(campaign)
    wanted = set(campaigns)
    return {
        row.sha256: with_goals(
            connection, row.content, [campaign for campaign in campaigns_at[row.id] if campaign in wanted]
        )
        for row in connection.execute(select(SiteRow.id, SiteRow.sha256, SiteRow.content))
        if not wanted.isdisjoint(campaigns_at.get(row.id, ()))
    }


def ambiguous_names(connection: Connection) -> dict[tuple[int, str], str]:
    """Return a distinct name for each goal that has several definitions at sites of one name.

    Trials of goals with a changed definition are not pooled: `red-armchair` becomes `red-armchair@1a2b3c4d`.

    Returns:
        (Number of the campaign, name of the goal) -> distinct name. Empty in records without such goals.
    """
    if connection.scalar(select(GoalRow.id).limit(1)) is None:
        return {}
    rows = connection.execute(
        select(SiteRow.name, TrialRow.goal, CampaignRow.id, GoalRow.sha256)
        .join(CampaignRow, CampaignRow.id == TrialRow.campaign_id)
        .join(SiteRow, SiteRow.id == CampaignRow.site_id)
        .outerjoin(GoalRow, GoalRow.id == TrialRow.goal_id)
        .where(TrialRow.goal.in_(select(GoalRow.name)))
        .distinct()
    ).all()
    hashes: dict[tuple[str, str], set[str]] = {}
    for site, name, _, sha256 in rows:
        hashes.setdefault((site, name), set()).add(sha256 or "")
    return {
        (campaign, name): distinct_name(name, sha256 or "")
        for site, name, campaign, sha256 in rows
        if len(hashes[site, name]) > 1
    }


def distinct_name(name: str, sha256: str) -> str:
    """Return the name of a goal with the beginning of its definition's hash."""
    return f"{name}@{sha256[:8] if sha256 else GoalKind.CATEGORY.value}"


def definitions(connection: Connection) -> dict[str, RecordedGoal]:
    """Return the recorded definitions by name, the latest of each name, and by distinct name."""
    found: dict[str, RecordedGoal] = {}
    for row in connection.execute(
        select(GoalRow.name, GoalRow.kind, GoalRow.sha256, GoalRow.content).order_by(GoalRow.id)
    ):
        goal = RecordedGoal(row.name, GoalKind(row.kind), row.sha256, row.content)
        found[goal.name] = found[distinct_name(goal.name, goal.sha256)] = goal
    return found
