"""Files of a bundle that follow from its record: tables, report, conditions, study and environment.

`vsnbench bundle` writes them; `vsnbench verify` writes them again and compares.
"""

import csv
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Table, select

from vsnbench import __version__
from vsnbench.errors import RecordError
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.build import build
from vsnbench.report.formats.csv import to_csv
from vsnbench.report.formats.json import to_json as report_json
from vsnbench.report.formats.markdown import markdown
from vsnbench.report.frames import Results
from vsnbench.report.study import forms
from vsnbench.report.study.findings import read_findings
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import DATABASE_NAME
from vsnbench.results.schema.engine import reading, to_json, transaction
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.schema.tables import ModelRow, ProcessRow, RobotRow, SiteRow, StepRow, VerdictRow
from vsnbench.results.studies.evidence import read_evidence
from vsnbench.results.studies.queries import studies
from vsnbench.runner.study.integrity import check_integrity
from vsnbench.study.file import parse_study
from vsnbench.study.lock import LockNote, write_note

TABLES = "tables"
STUDY_FILE = "study/study.yaml"
RAW_TABLES: Mapping[str, tuple[Table, frozenset[str]]] = {
    "steps": (StepRow.__table__, frozenset({"probabilities", "details"})),  # type: ignore[dict-item]
    "verdicts": (VerdictRow.__table__, frozenset()),  # type: ignore[dict-item]
}
"""Name of a CSV file -> table of the record, and the columns that are left out."""
_AT_ONCE = 500
ENVIRONMENT = "environment.json"
MADE_BY = "made_by_vsnbench"
"""Key of the version that made the report and the tables."""


def write_derived_files(results: Path, into: Path, note: LockNote | None = None) -> None:
    """Write the files that follow from the record in the results directory of a bundle.

    Raises:
        RecordError: the record cannot be read, or a file cannot be written.
    """
    url = sqlite_url(results / DATABASE_NAME)
    try:
        for folder in (TABLES, "report", "conditions"):
            (into / folder).mkdir(parents=True, exist_ok=True)
        _write_tables(url, into / TABLES)
        _write_report(url, into / "report")
        with open_record(url) as engine, transaction(reading(engine)) as connection:
            for table in (SiteRow, RobotRow, ModelRow):
                _write_conditions(connection, table.__table__, into / "conditions")  # type: ignore[arg-type]
            _write_json(into / ENVIRONMENT, {MADE_BY: __version__} | _environment(connection))
        _write_study(url, into, note)
    except OSError as error:
        raise RecordError(f"cannot write {into}: {error.strerror or error}", advice="free some space") from error


def _write_tables(url: str, directory: Path) -> None:
    record = Results(url)
    record.campaigns().to_csv(directory / "campaigns.csv", index=False, lineterminator="\n")
    record.episodes().to_csv(directory / "episodes.csv", index=False, lineterminator="\n")
    with open_record(url) as engine, transaction(reading(engine)) as connection:
        for name, (table, left_out) in RAW_TABLES.items():
            columns = [column for column in table.columns if column.name not in left_out]
            query = select(*columns).order_by(*table.primary_key.columns)
            with (directory / f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow([column.name for column in columns])
                rows = connection.execution_options(yield_per=_AT_ONCE).execute(query)
                writer.writerows([_cell(value) for value in row] for row in rows)


def _cell(value: Any) -> Any:
    if isinstance(value, dict | list):
        return json.dumps(value, ensure_ascii=False)
    return value.isoformat() if hasattr(value, "isoformat") else value


def _write_report(url: str, directory: Path) -> None:
    report = build(url, Selection(), None)
    tables = report.tables(long=True)
    content = {
        "report.json": report_json(
            report.results, report.questions, report.activity, report.record, report.operator_activity
        ),
        "report.csv": to_csv(report.results),
        "report.md": markdown(tables),
    }
    _write(directory, content.items())


def _write_conditions(connection: Connection, table: Table, directory: Path) -> None:
    for row in connection.execute(select(table).order_by(table.c.sha256)).mappings():
        content = {name: value for name, value in row.items() if name != "id"}
        _write_json(directory / f"{table.name}-{row['sha256'][:12]}.json", content)


def _environment(connection: Connection) -> dict[str, Any]:
    """Return the processes of a record with their commands, and each distinct environment once.

    A package's `sha256` is that of the sorted lines of its wheel's RECORD, as installed when the process ran; null if
    the process ran no trials, or was older than this field.
    """
    environments: list[dict[str, Any]] = []
    numbers: dict[str, int] = {}
    processes = []
    for row in connection.execute(select(ProcessRow.__table__).order_by(ProcessRow.id)).mappings():
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


def _write_study(url: str, into: Path, note: LockNote | None) -> None:
    with open_record(url) as engine:
        known = studies(engine)
        if not known:
            return
        evidence = read_evidence(engine, known[0].id)
    study = known[0]
    plan = parse_study(study.content, STUDY_FILE)
    integrity = check_integrity(study, evidence, plan, note)
    found = read_findings(url, study, plan, differences=integrity.differences, remarks=integrity.remarks)
    (into / STUDY_FILE).parent.mkdir(exist_ok=True)
    (into / STUDY_FILE).write_bytes(study.content.encode())
    if note is not None:
        write_note(into / STUDY_FILE, note)
    _write(into / "report", (("study.json", forms.to_json(found)), ("study.md", forms.to_markdown(found))))


def _write(directory: Path, files: Iterable[tuple[str, str]]) -> None:
    for name, content in files:
        (directory / name).write_bytes(content.encode())


def _write_json(path: Path, value: object) -> None:
    text = json.dumps(value, indent=2, ensure_ascii=False, sort_keys=True, default=str)
    path.write_bytes(f"{text}\n".encode())
