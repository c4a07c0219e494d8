"""Finds the files of recorded weights on this machine, by their hash."""

import os
import shlex
from collections.abc import Iterator
from pathlib import Path

from sqlalchemy import Connection, select

from vsnbench.errors import UsageError
from vsnbench.files.package_data import resource_directory
from vsnbench.models.checkpoints.weights import file_sha256, weights_directory
from vsnbench.results.schema.tables import ModelRow, ProcessRow


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
    found: dict[str, Path] = {}
    for path in _candidates(connection):
        if len(found) < len(wanted) and (sha256 := file_sha256(path)) in wanted:
            found.setdefault(sha256, path)
    if missing := sorted(wanted.keys() - found.keys()):
        raise UsageError(
            f"the weights of {wanted[missing[0]]} with SHA-256 {missing[0]} are not on this machine",
            advice=f"put the file into {weights_directory()}, or leave --with-weights out",
            code="missing-weights",
        )
    return {f"weights/{sha256[:12]}{path.suffix}": path for sha256, path in sorted(found.items())}


def _candidates(connection: Connection) -> Iterator[Path]:
    for directory in (resource_directory("weights"), weights_directory()):
        yield from (path for path in sorted(directory.glob("*")) if path.is_file())
    words: dict[str, None] = {}
    for command in connection.scalars(select(ProcessRow.command).order_by(ProcessRow.id)):
        try:
            words |= dict.fromkeys(word.rpartition("=")[2] for word in shlex.split(command))
        except ValueError:  # a quotation mark that is not closed
            continue
    yield from (path for word in words if word and (path := Path(os.path.expanduser(word))).is_file())  # noqa: PTH111 - Path raises for ~unknown
