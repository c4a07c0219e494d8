"""Checks every value of a record: its type and range, references, and the hashes that rows have of their content."""

from sqlalchemy import func, inspect, select, text

from vsnbench.evidence.verification.checks import Check, Finding, Progress, cell, finding
from vsnbench.evidence.verification.record import VerifiedRecord
from vsnbench.results.reading.identities import IDENTIFIED, identity_faults
from vsnbench.results.reading.integrity import record_faults
from vsnbench.results.schema.base import TableBase


def check_values(record: VerifiedRecord, progress: Progress) -> Check:
    """Check every row of every table."""
    check = Check("values", "rows")
    connection = record.connection
    with check.failing("the database"):
        there = set(inspect(connection).get_table_names())
        for table in TableBase.metadata.sorted_tables:
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
    for done, identified in enumerate(IDENTIFIED, start=1):
        with check.failing(f"{identified.__tablename__}s"):
            for fault in identity_faults(connection, identified):
                if isinstance(fault, str):
                    check.skip(fault)
                else:
                    check.findings.append(cell(fault.table, fault.row, fault.column, fault.text))
                    check.failed += 1
        progress("checking values", done, len(IDENTIFIED))
    return check


def _as_finding(fault: str) -> Finding:
    where, _, words = fault.partition(": ")
    column, is_cell, rest = words.partition(" is ")
    return finding(f"{where}: {column}", f"is {rest}") if is_cell else finding("", fault)
