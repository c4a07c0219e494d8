"""Checks every value of a record: its type and range, references, and the hashes that rows have of their content."""

from collections.abc import Iterator, Mapping
from hashlib import sha256
from typing import Any

from pydantic import ValidationError
from sqlalchemy import func, inspect, select, text

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.reading.integrity import record_faults
from vsnbench.results.schema.base import Base
from vsnbench.results.schema.tables import Campaign, Goal, Model, Robot, Site
from vsnbench.results.writing.campaigns import ModelIdentity, content_sha256
from vsnbench.sites.goals import SiteGoal
from vsnbench.sites.site import Site as SurveyedSite
from vsnbench.values.robot_identity import RobotIdentity
from vsnbench.values.robot_profile import RobotProfile
from vsnbench.verification.checks import Check, Finding, Progress, cell, finding
from vsnbench.verification.record import VerifiedRecord

_IMPORTED = "names only, from an import (hashes)"


def check_values(record: VerifiedRecord, progress: Progress) -> Check:
    """Check every row of every table."""
    check = Check("values", "rows")
    connection = record.connection
    with check.failing("the database"):
        there = set(inspect(connection).get_table_names())
        for table in Base.metadata.sorted_tables:
            if table.name in there:
                check.checked += connection.scalar(select(func.count()).select_from(table)) or 0
    with check.failing("the database"):
        found = [_as_finding(fault) for fault in record_faults(connection)]
        check.findings += found
        check.failed += len({one.where.rpartition(":")[0] for one in found})
    with check.failing("the database"):
        for (line,) in connection.execute(text("PRAGMA integrity_check")):
            if line != "ok":
                check.fail("the database", line)
    for done, check_table in enumerate((_sites, _robots, _models, _goals, _campaigns), start=1):
        with check.failing(check_table.__name__.strip("_")):
            for where in check_table(record):
                if isinstance(where, str):
                    check.skip(where)
                else:
                    check.findings.append(where)
                    check.failed += 1
        progress("checking values", done, 5)
    return check


def _as_finding(fault: str) -> Finding:
    where, _, words = fault.partition(": ")
    column, is_cell, rest = words.partition(" is ")
    return finding(f"{where}: {column}", f"is {rest}") if is_cell else finding("", fault)


def _rows(record: VerifiedRecord, table: type[Base]) -> Iterator[Any]:
    yield from record.connection.execute(select(table.__table__).order_by(table.__table__.c.id))


def _sites(record: VerifiedRecord) -> Iterator[Finding | str]:
    for row in _rows(record, Site):
        try:
            site = SurveyedSite.model_validate(row.content)
        except ValidationError:
            yield _IMPORTED
            continue
        if site.sha256 != row.sha256:
            yield cell("site", row.id, "content", "does not have the hash in sha256")
        yield from _equal("site", row, {"name": site.name, "title": site.title})


def _robots(record: VerifiedRecord) -> Iterator[Finding | str]:
    for row in _rows(record, Robot):
        try:
            profile = RobotProfile.model_validate(row.profile)
        except ValidationError:
            yield _IMPORTED
            continue
        if ":" in row.kind:
            yield "hash of a robot of a plug-in: its code is not in the record"
        elif RobotIdentity(profile, row.kind, row.simulated).sha256 != row.sha256:
            yield cell("robot", row.id, "profile", "profile, kind and simulated do not have the hash in sha256")
        yield from _equal("robot", row, {"name": profile.name, "title": profile.title})


def _models(record: VerifiedRecord) -> Iterator[Finding | str]:
    for row in _rows(record, Model):
        if ModelIdentity.of_row(row).sha256 != row.sha256:
            yield cell("model", row.id, "sha256", "name, weights, settings, files and code have another hash")


def _goals(record: VerifiedRecord) -> Iterator[Finding | str]:
    for row in _rows(record, Goal):
        goal = SiteGoal.model_validate(row.content)
        if goal.sha256 != row.sha256:
            yield cell("goal", row.id, "content", "does not have the hash in sha256")
        yield from _equal("goal", row, {"name": goal.id, "kind": goal.kind.value})
        if row.image is not None and (goal.image is None or sha256(row.image).hexdigest() != goal.image.sha256):
            yield cell("goal", row.id, "image", "does not have the hash in the goal's definition")


def _campaigns(record: VerifiedRecord) -> Iterator[Finding | str]:
    hashes = {
        table: dict(record.connection.execute(select(table.id, table.sha256)).all()) for table in (Site, Robot, Model)
    }
    for row in _rows(record, Campaign):
        parameters = ProtocolParameters.from_record(row.protocol)
        known = {content_sha256(row.protocol), content_sha256(parameters.model_dump(mode="json"))}
        if row.protocol_sha256 not in known:
            yield cell("campaign", row.id, "protocol", "does not have the hash in protocol_sha256")
        parts = [hashes[Site][row.site_id], hashes[Robot][row.robot_id], hashes[Model][row.model_id]]
        if content_sha256([*parts, row.protocol_sha256, row.conditions, row.seed]) != row.key:
            yield cell("campaign", row.id, "key", "site, robot, model, protocol, conditions and seed have another hash")


def _equal(table: str, row: Any, expected: Mapping[str, str]) -> Iterator[Finding]:
    for column, value in expected.items():
        if getattr(row, column) != value:
            yield cell(table, row.id, column, f"{getattr(row, column)!r}, and its content has {value!r}")
