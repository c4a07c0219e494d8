"""Describes the environments in which the episodes of a record ran, and the commands that ran them."""

from typing import Any

from sqlalchemy import Connection, select

from vsnbench.results.schema.engine import to_json
from vsnbench.results.schema.tables import Process


def environment(connection: Connection) -> dict[str, Any]:
    """Return the processes of a record with their commands, and each distinct environment once.

    A package's `sha256` is that of the sorted lines of its wheel's RECORD, as installed when the process ran; null if
    the process ran no trials, or was older than this field.
    """
    environments: list[dict[str, Any]] = []
    numbers: dict[str, int] = {}
    processes = []
    for row in connection.execute(select(Process.__table__).order_by(Process.id)).mappings():
        platform = dict(row["platform"])
        hashes = platform.pop("package_hashes", None) or {}
        packages = [
            {"name": name, "version": version, "sha256": hashes.get(name)}
            for name, version in sorted(row["packages"].items())
        ]
        there = {"platform": platform, "packages": packages}
        number = numbers.setdefault(to_json(there, in_order=True), len(environments))
        if number == len(environments):
            environments.append(there)
        names = ("id", "command", "operator", "host", "vsnbench_version", "git_commit", "git_dirty")
        started_at = row["started_at"].isoformat()
        processes.append({**{name: row[name] for name in names}, "started_at": started_at, "environment": number})
    return {"environments": environments, "processes": processes}
