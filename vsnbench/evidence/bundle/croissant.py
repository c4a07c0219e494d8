"""Describes the tables of a bundle in the format Croissant, which libraries for machine learning read."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import Boolean, Float, Integer
from sqlalchemy.types import TypeEngine

from vsnbench.evidence.bundle.derived_files import RAW_TABLES
from vsnbench.evidence.bundle.readme import BundleAbout
from vsnbench.evidence.bundle.stored_zip import StoredFile
from vsnbench.report.analysis.episodes_frame import COLUMNS
from vsnbench.report.frames import CAMPAIGN_COLUMNS
from vsnbench.results.schema.base import UtcDateTime

CROISSANT = "croissant.json"
_TEXT, _INTEGER, _FLOAT, _BOOLEAN, _TIME = ("sc:Text", "sc:Integer", "sc:Float", "sc:Boolean", "sc:DateTime")
_OF_KIND: Sequence[tuple[type[TypeEngine[Any]], str]] = (
    (Boolean, _BOOLEAN),
    (Integer, _INTEGER),
    (Float, _FLOAT),
    (UtcDateTime, _TIME),
)
_TYPES: Mapping[str, frozenset[str]] = {
    _INTEGER: frozenset(
        {"episode", "condition", "campaign", "process", "session", "trial", "start", "repetition", "actions", "seed"}
    ),
    _FLOAT: frozenset({"spl", "soft_spl", "sct"}),
    _BOOLEAN: frozenset({"success", "goal_in_sight"}),
    _TIME: frozenset({"started_at", "ended_at"}),
}
"""Type -> columns of `episodes.csv` and `campaigns.csv`; numbers with a unit in their name are floats, others text."""


def croissant(about: BundleAbout, tables: Mapping[str, StoredFile]) -> str:
    """Return the Croissant description of tables, by name."""
    content: dict[str, Any] = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "name": about.title,
        "description": about.description,
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "datePublished": about.date,
        "version": "1.0.0",
        "citeAs": about.citation,
        "license": about.licence or "not stated",
        "distribution": [_file(file) for file in tables.values()],
        "recordSet": [_record_set(name, file) for name, file in tables.items()],
    }
    if about.authors:
        content["creator"] = [{"@type": "sc:Person", "name": name} for name in about.authors]
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def _file(file: StoredFile) -> dict[str, str]:
    return {
        "@type": "cr:FileObject",
        "@id": file.name,
        "name": file.name,
        "contentUrl": file.name,
        "contentSize": f"{file.size_bytes} B",
        "encodingFormat": "text/csv",
        "sha256": file.sha256,
    }


def _record_set(name: str, file: StoredFile) -> dict[str, Any]:
    fields = [
        {
            "@type": "cr:Field",
            "@id": f"{name}/{column}",
            "name": column,
            "description": description,
            "dataType": kind,
            "source": {"fileObject": {"@id": file.name}, "extract": {"column": column}},
        }
        for column, description, kind in _columns(name)
    ]
    return {"@type": "cr:RecordSet", "@id": name, "name": name, "field": fields}


def _columns(name: str) -> list[tuple[str, str, str]]:
    """Return the columns of a table with description and type."""
    if name in RAW_TABLES:
        table, left_out = RAW_TABLES[name]
        described = f"column of the table {table.name} in docs/schema.md"
        return [(column.name, described, _kind(column.type)) for column in table.columns if column.name not in left_out]
    columns = CAMPAIGN_COLUMNS if name == "campaigns" else COLUMNS | CAMPAIGN_COLUMNS_OF_EPISODES
    return [(column, text, _type_of(column)) for column, text in columns.items()]


def _kind(type_: TypeEngine[Any]) -> str:
    return next((name for kind, name in _OF_KIND if isinstance(type_, kind)), _TEXT)


def _type_of(column: str) -> str:
    if column.endswith(("_m", "_s")):
        return _FLOAT
    return next((kind for kind, columns in _TYPES.items() if column in columns), _TEXT)


CAMPAIGN_COLUMNS_OF_EPISODES = {
    name: CAMPAIGN_COLUMNS[name] for name in ("model", "weights_label", "robot", "environment", "site")
}
"""Columns of the campaign in `episodes.csv`, at its end."""
_CONTEXT: Mapping[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    **{
        name: f"cr:{name}"
        for name in (
            *("citeAs", "column", "equivalentProperty", "extract", "field", "fileProperty", "fileObject", "fileSet"),
            *("format", "includes", "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet"),
            *("references", "regex", "repeated", "replace", "samplingRate", "separator", "source", "subField"),
            "transform",
        )
    },
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "rai": "http://mlcommons.org/croissant/RAI/",
    "sc": "https://schema.org/",
}
"""The standard context of Croissant 1.0, without which its readers warn."""
