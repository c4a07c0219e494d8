"""The results directory: location of the database and the episodes' files, with checks of access and space."""

import os
import shlex
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Self

from vsnbench.config import BUILT_IN_RESULTS, config_defaults, same_file_above
from vsnbench.errors import RecordError
from vsnbench.files.home import expanded
from vsnbench.results.database_url import redacted_url, sqlite_path, sqlite_url
from vsnbench.results.files.confined_paths import confined

ENVIRONMENT_VARIABLE = "VSNBENCH_RESULTS"
TEMPORARY_RESULTS = "VSNBENCH_PASSING_RESULTS"
"""Environment variable that marks results as temporary (`run --watch`)."""
DATABASE_NAME = "vsnbench.db"
LOW_SPACE_BYTES = 200 * 2**20
"""Space for two episodes of 640 x 480 images with depth noise (94 MB each); a run does not start with less."""


class KeepFiles(StrEnum):
    """Which files of an episode are kept; its database rows are the same."""

    ALL = "all"
    """Images, and the copy of the episode for Rerun."""
    IMAGES = "images"
    """Images; `vsnbench view` makes the copy for Rerun from them."""
    NONE = "none"
    """No files; the trial must be run again to get images."""

    @property
    def description(self) -> str:
        """Description for messages."""
        return {
            KeepFiles.ALL: "images and a copy for Rerun of each episode are kept",
            KeepFiles.IMAGES: "images are kept; `vsnbench view` makes Rerun's copy",
            KeepFiles.NONE: "no images are kept",
        }[self]

    def note(self, new_record: str) -> str:
        """Message of a run: what is kept, if images are not or the record is new, and the note of a new record."""
        kept = f"--keep {self}: {self.description}" if new_record or self is KeepFiles.NONE else ""
        return "\n".join(filter(None, (kept, new_record)))


@dataclass(frozen=True, slots=True)
class ResultsDirectory:
    """Database and episode files, which can be copied as a unit."""

    path: Path
    database_url: str

    @classmethod
    def locate(
        cls, path: Path | None = None, database_url: str | None = None, environment: Mapping[str, str] = os.environ
    ) -> Self:
        """Return the results directory of a command without accessing it.

        Args:
            path: value of --results. Default: $VSNBENCH_RESULTS, then ./results.
            database_url: value of --db. Default: `vsnbench.db` in the directory.
            environment: environment variables.
        """
        where = expanded(path or environment.get(ENVIRONMENT_VARIABLE) or BUILT_IN_RESULTS)
        if str(where).startswith("-"):
            where = Path.cwd() / where  # other programs, and commands that messages suggest, would read an option
        return cls(where, database_url or sqlite_url(where / DATABASE_NAME))

    @property
    def options(self) -> str:
        """Command-line options that select the same record, each with a leading blank.

        Values from the configuration file are left out. Values from environment variables are included, because
        another terminal may not have them.
        """
        configured = next(default.value for default in config_defaults(environment={}) if default.name == "results")
        usual = Path(configured or BUILT_IN_RESULTS)
        known = self.path == usual == Path(os.environ.get(ENVIRONMENT_VARIABLE) or usual)
        results = "" if known else f" --results {shlex.quote(str(self.path))}"
        if self.has_own_database:
            return results
        url = self.database_url if sqlite_path(self.database_url) else self.database_label
        return f"{results} --db {shlex.quote(url)}"

    @property
    def database_label(self) -> str:
        """The database without its password."""
        return redacted_url(self.database_url)

    @property
    def has_own_database(self) -> bool:
        """Whether the database is the SQLite file of this directory."""
        return self.database_url == sqlite_url(self.path / DATABASE_NAME)

    @property
    def new_record_note(self) -> str:
        """Message about the location of a new record; empty if a record exists or the database is elsewhere."""
        file = self.path / DATABASE_NAME
        if not self.has_own_database or file.is_file():
            return ""
        note = f"new results directory: {self.path.absolute()}"
        if (above := same_file_above(file)) is None:
            return note
        return (
            f"{note}; earlier results are in {above.parent} (--results {shlex.quote(str(above.parent))} adds to them)"
        )

    def prepare(self) -> None:
        """Create the directory and check that it is writable and has space.

        Raises:
            RecordError: it cannot be used.
        """
        try:
            (self.path / "episodes").mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=self.path, prefix=".writable-") as probe:
                probe.write(b"vsnbench")
                probe.flush()
        except OSError as error:
            raise RecordError(
                f"cannot write the results directory {self.path}: {error.strerror or error}",
                advice=f"choose another with --results or ${ENVIRONMENT_VARIABLE}",
            ) from error
        if (free := self.free_bytes()) < LOW_SPACE_BYTES:
            raise RecordError(
                f"the disk of {self.path} has only {free / 2**20:.0f} MiB left, a run needs "
                f"{LOW_SPACE_BYTES / 2**20:.0f}",
                advice="free some space or choose another directory with --results",
            )

    def free_bytes(self) -> int:
        """Return the free space of the directory's disk for an ordinary user."""
        return shutil.disk_usage(self.path).free

    def episode_directory(self, images_directory: str) -> Path:
        """Return the directory of an episode's files from its database value (`episodes/000017`).

        Raises:
            RecordError: the value leads out of the results directory.
        """
        confined(self.path, images_directory)
        return self.path / images_directory
