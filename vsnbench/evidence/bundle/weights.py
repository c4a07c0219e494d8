"""Finds the files of recorded weights and scans on this machine, by their hash."""

import itertools
import os
import shlex
from collections.abc import Container, Iterable, Iterator
from pathlib import Path
from typing import Final

from sqlalchemy import Connection, select

from vsnbench.errors import UsageError
from vsnbench.files.package_data import resource_directory
from vsnbench.models.checkpoints.weights import file_sha256, weights_directory
from vsnbench.results.schema.tables import ModelRow, ProcessRow, SiteRow
from vsnbench.sites.scan import SCAN_SUFFIX

SCANS: Final = "scans"
"""Folder of a bundle with the scans of its sites."""


def find_weights_by_hash(connection: Connection) -> dict[str, Path]:
    """Return the weights of a record's models: name in a bundle -> file.

    They are searched for among the embedded weights, in the directory of weights, and among the files that the
    recorded commands name.

    Raises:
        UsageError: a file is not on this machine.
    """
    wanted: dict[str, str] = {}
    for name, sha256, settings in connection.execute(select(ModelRow.name, ModelRow.weights_sha256, ModelRow.settings)):
        wanted |= {str(value): name for value in (sha256, settings.get("detector_sha256")) if value}
    directories = (resource_directory("weights"), weights_directory())
    stored = (path for directory in directories for path in sorted(directory.glob("*")) if path.is_file())
    found = _with_hashes(itertools.chain(stored, _named_files(connection)), wanted)
    if missing := sorted(wanted.keys() - found.keys()):
        raise UsageError(
            f"the weights of {wanted[missing[0]]} with SHA-256 {missing[0]} are not on this machine",
            advice=f"put the file into {weights_directory()}, or leave --with-weights out",
            code="missing-weights",
        )
    return {f"weights/{sha256[:12]}{path.suffix}": path for sha256, path in sorted(found.items())}


def find_scans_by_hash(connection: Connection) -> dict[str, Path]:
    """Return the scans of a record's sites: name in a bundle -> file.

    They are searched for next to the site files that the recorded commands name.

    Raises:
        UsageError: a site has no scan, or its file is not on this machine.
    """
    sites = connection.execute(select(SiteRow.name, SiteRow.content)).all()
    wanted = {content["scan"]["sha256"]: name for name, content in sites if content.get("scan")}
    folders = dict.fromkeys(path.parent for path in _named_files(connection) if path.suffix in (".yaml", ".yml"))
    found = _with_hashes((path for folder in folders for path in sorted(folder.glob(f"*{SCAN_SUFFIX}"))), wanted)
    if missing := sorted(wanted.keys() - found.keys()):
        raise UsageError(
            f"the scan of {wanted[missing[0]]} with SHA-256 {missing[0]} is not on this machine",
            advice="put its file next to the site file that the trials ran with, or leave --with-scan out",
            code="missing-scan",
        )
    if not wanted:
        raise UsageError("no site of these results has a scan", advice="leave --with-scan out", code="missing-scan")
    return {f"{SCANS}/{sha256[:12]}{SCAN_SUFFIX}": path for sha256, path in sorted(found.items())}


def _with_hashes(paths: Iterable[Path], wanted: Container[str]) -> dict[str, Path]:
    """Return the first file with each wanted hash."""
    found: dict[str, Path] = {}
    for path in paths:
        if (sha256 := file_sha256(path)) in wanted:
            found.setdefault(sha256, path)
    return found


def _named_files(connection: Connection) -> Iterator[Path]:
    """Yield the files that the recorded commands name."""
    words: dict[str, None] = {}
    for command in connection.scalars(select(ProcessRow.command).order_by(ProcessRow.id)):
        try:
            words |= dict.fromkeys(word.rpartition("=")[2] for word in shlex.split(command))
        except ValueError:  # a quotation mark that is not closed
            continue
    yield from (path for word in words if word and (path := Path(os.path.expanduser(word))).is_file())  # noqa: PTH111 - Path raises for ~unknown
