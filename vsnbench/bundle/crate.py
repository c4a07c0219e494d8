"""Writes the RO-Crate metadata of a bundle: a JSON-LD file with every file, its size and its SHA-256.

The entities are collected in a temporary file, because a bundle can have a million files.
"""

import json
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, BinaryIO, Self
from urllib.parse import quote

from vsnbench.bundle.stored_zip import StoredFile

METADATA = "ro-crate-metadata.json"
_SPECIFICATION = "https://w3id.org/ro/crate/1.3"
_SPDX = "https://spdx.org/licenses/"
_NO_LICENCE = "#no-licence"
_FORMATS = {
    "csv": "text/csv",
    "db": "application/vnd.sqlite3",
    "jpg": "image/jpeg",
    "json": "application/json",
    "lock": "application/json",
    "md": "text/markdown",
    "png": "image/png",
    "tum": "text/plain",
    "txt": "text/plain",
    "yaml": "application/yaml",
}
_DESCRIPTIONS = {
    "README.md": "What this is and how to check it",
    "environment.json": "Commands that ran the episodes, and the packages that they ran with",
    "croissant.json": "Croissant description of the tables",
    "report/report.json": "Success rates, intervals and comparisons",
    "results/vsnbench.db": "The record: campaigns, episodes, steps and verdicts",
    "study/study.yaml": "Plan of the study, as locked or last amended",
    "tables/campaigns.csv": "A row per campaign",
    "tables/episodes.csv": "A row per episode with its outcome and measures",
    "tables/steps.csv": "A row per action with poses and digests of its images",
    "tables/verdicts.csv": "A row per verdict",
}


@dataclass(frozen=True, slots=True)
class BundleAbout:
    """What a bundle says about itself."""

    title: str
    description: str
    date: str
    """Date of the newest row of the record, as YYYY-MM-DD: equal records make equal bundles."""
    authors: tuple[str, ...]
    licence: str
    """SPDX identifier, URL or text; empty if the authors have not stated one."""
    citation: str


class CrateWriter:
    """Collects the files of a bundle; a context manager."""

    def __init__(self, about: BundleAbout) -> None:
        self._about = about
        self._entities: BinaryIO = tempfile.TemporaryFile()  # noqa: SIM115 - closed by __exit__
        self._parts: list[str] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._entities.close()

    def add(self, file: StoredFile) -> None:
        """Add a file of the bundle."""
        self._add_file(file)
        self._parts.append(file.name)

    def add_folder(self, name: str, title: str, files: Iterable[StoredFile]) -> None:
        """Add a directory of the bundle with its files."""
        names = []
        for file in files:
            self._add_file(file)
            names.append(file.name)
        self._write({"@id": f"{name}/", "@type": "Dataset", "name": title, "hasPart": _references(names)})
        self._parts.append(f"{name}/")

    def _add_file(self, file: StoredFile) -> None:
        own_name = file.name.rpartition("/")[2]
        entity = {
            "@id": file.name,
            "@type": "File",
            "name": _DESCRIPTIONS.get(file.name, own_name),
            "contentSize": str(file.size_bytes),
            "encodingFormat": _FORMATS.get(own_name.rpartition(".")[2], "application/octet-stream"),
            "sha256": file.sha256,
        }
        self._write(entity)

    def _write(self, entity: Any) -> None:
        self._entities.write(b",\n" + json.dumps(entity, ensure_ascii=False).encode())

    def write(self, target: BinaryIO) -> None:
        """Write the metadata."""
        descriptor = {
            "@id": METADATA,
            "@type": "CreativeWork",
            "about": {"@id": "./"},
            "conformsTo": {"@id": _SPECIFICATION},
        }
        head = [descriptor, self._root(), *self._people()]
        text = ",\n".join(json.dumps(entity, ensure_ascii=False) for entity in head)
        target.write(f'{{"@context": "{_SPECIFICATION}/context", "@graph": [\n{text}'.encode())
        self._entities.seek(0)
        while part := self._entities.read(2**20):
            target.write(part)
        target.write(b"\n]}\n")

    def _root(self) -> dict[str, Any]:
        about = self._about
        root: dict[str, Any] = {
            "@id": "./",
            "@type": "Dataset",
            "name": about.title,
            "description": about.description,
            "datePublished": about.date,
            "license": {"@id": _licence_id(about.licence)},
            "creditText": about.citation,
            "hasPart": _references(self._parts),
        }
        if about.authors:
            root["author"] = _references(map(_own_id, about.authors))
        return root

    def _people(self) -> list[dict[str, Any]]:
        """Return the entities that the root refers to and that are not files."""
        licence = self._about.licence
        named = licence or "No licence was stated: ask the authors before you use it."
        return [
            {"@id": _licence_id(licence), "@type": "CreativeWork", "name": named, "description": named},
            *({"@id": _own_id(name), "@type": "Person", "name": name} for name in self._about.authors),
        ]


def _licence_id(licence: str) -> str:
    if not licence:
        return _NO_LICENCE
    if "://" in licence:
        return licence
    return _own_id(licence) if " " in licence else f"{_SPDX}{licence}"


def _own_id(name: str) -> str:
    """Return the identity of something that is described in the crate only."""
    return f"#{quote(name)}"


def _references(identities: Iterable[str]) -> list[dict[str, str]]:
    return [{"@id": identity} for identity in identities]
