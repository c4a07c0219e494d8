"""Compares the content of sites, robots, models, goals and campaigns with the hashes that identify them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

from pydantic import ValidationError
from sqlalchemy import Connection, Select, select

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.schema.base import TableBase
from vsnbench.results.schema.tables import CampaignRow, GoalRow, ModelRow, RobotRow, SiteRow
from vsnbench.results.writing.campaigns import card_of_row, content_sha256, model_sha256
from vsnbench.sites.goals import SiteGoal
from vsnbench.sites.site import Site as SurveyedSite
from vsnbench.values.robot_identity import RobotIdentity
from vsnbench.values.robot_profile import RobotProfile

_IMPORTED = "names only, from an import (hashes)"


@dataclass(frozen=True, slots=True)
class RowFault:
    """A row whose content does not have the hash in it."""

    table: str
    row: int
    column: str
    text: str


def identity_faults(
    connection: Connection, table: type[TableBase], numbers: Select[int] | None = None
) -> Iterator[RowFault | str]:
    """Yield the faults of one of the tables in `IDENTIFIED`, or as text why a row cannot be checked.

    Args:
        connection: a transaction.
        table: the table.
        numbers: rows to check; None for all.

    Raises:
        ValueError: the content of a row is invalid.
    """
    query = select(table.__table__).order_by(table.__table__.c.id)
    if numbers is not None:
        query = query.where(table.__table__.c.id.in_(numbers))
    check = {SiteRow: _site, RobotRow: _robot, ModelRow: _model, GoalRow: _goal}.get(table)
    if check is not None:
        for row in connection.execute(query):
            yield from check(row)
        return
    hashes = {
        part: dict(connection.execute(select(part.id, part.sha256)).all()) for part in (SiteRow, RobotRow, ModelRow)
    }
    for row in connection.execute(query):
        yield from _campaign(
            row, [hashes[SiteRow][row.site_id], hashes[RobotRow][row.robot_id], hashes[ModelRow][row.model_id]]
        )


IDENTIFIED: tuple[type[TableBase], ...] = (SiteRow, RobotRow, ModelRow, GoalRow, CampaignRow)
"""Tables whose rows contain the hash of their content."""


def _site(row: Any) -> Iterator[RowFault | str]:
    try:
        site = SurveyedSite.model_validate(row.content)
    except ValidationError:
        yield _IMPORTED
        return
    if site.sha256 != row.sha256:
        yield RowFault("site", row.id, "content", "does not have the hash in sha256")
    yield from _equal("site", row, {"name": site.name, "title": site.title})


def _robot(row: Any) -> Iterator[RowFault | str]:
    try:
        profile = RobotProfile.model_validate(row.profile)
    except ValidationError:
        yield _IMPORTED
        return
    if ":" in row.kind:
        yield "hash of a robot of a plug-in: its code is not in the record"
    elif RobotIdentity(profile, row.kind, row.simulated).sha256 != row.sha256:
        yield RowFault("robot", row.id, "profile", "profile, kind and simulated do not have the hash in sha256")
    yield from _equal("robot", row, {"name": profile.name, "title": profile.title})


def _model(row: Any) -> Iterator[RowFault | str]:
    if model_sha256(card_of_row(row)) != row.sha256:
        yield RowFault("model", row.id, "sha256", "name, weights, settings, files and code have another hash")


def _goal(row: Any) -> Iterator[RowFault | str]:
    goal = SiteGoal.model_validate(row.content)
    if goal.sha256 != row.sha256:
        yield RowFault("goal", row.id, "content", "does not have the hash in sha256")
    yield from _equal("goal", row, {"name": goal.id, "kind": goal.kind.value})
    if row.image is not None and (goal.image is None or sha256(row.image).hexdigest() != goal.image.sha256):
        yield RowFault("goal", row.id, "image", "does not have the hash in the goal's definition")


def _campaign(row: Any, parts: list[str]) -> Iterator[RowFault | str]:
    parameters = ProtocolParameters.from_record(row.protocol)
    known = {content_sha256(row.protocol), content_sha256(parameters.model_dump(mode="json"))}
    if row.protocol_sha256 not in known:
        yield RowFault("campaign", row.id, "protocol", "does not have the hash in protocol_sha256")
    if content_sha256([*parts, row.protocol_sha256, row.conditions, row.seed]) != row.key:
        text = "site, robot, model, protocol, conditions and seed have another hash"
        yield RowFault("campaign", row.id, "key", text)


def _equal(table: str, row: Any, expected: Mapping[str, str]) -> Iterator[RowFault]:
    for column, value in expected.items():
        if getattr(row, column) != value:
            yield RowFault(table, row.id, column, f"{getattr(row, column)!r}, and its content has {value!r}")
