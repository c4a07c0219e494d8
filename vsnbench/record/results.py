"""The results directory: where the database and the episodes' files lie, and whether they can be written."""

import os
import shlex
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Self

from vsnbench.database_url import shown_url, sqlite_url
from vsnbench.errors import RecordError
from vsnbench.lab_file import BUILT_IN_RESULTS, lab_defaults
from vsnbench.record.confined import confined

ENVIRONMENT_VARIABLE = "VSNBENCH_RESULTS"
DATABASE_NAME = "vsnbench.db"
LOW_SPACE_BYTES = 200 * 2**20
"""Two episodes of 640 x 480 images with a depth camera's noise (94 MB each): with less, a run does not begin."""


class Kept(StrEnum):
    """What of an episode is kept beside its rows in the database; the rows are the same, with the images' hashes."""

    FULL = "full"
    """Images, and the copy of the episode for Rerun."""
    LEAN = "lean"
    """Images; the copy for Rerun is made of them when somebody views the episode."""
    NUMBERS = "numbers"
    """Nothing: what the robot saw can only be drawn again, by running the trial again."""

    @property
    def words(self) -> str:
        """What is kept, for people."""
        return {
            Kept.FULL: "images and a copy for Rerun of each episode are kept",
            Kept.LEAN: "images are kept; `vsnbench view` makes Rerun's copy",
            Kept.NUMBERS: "no images are kept",
        }[self]


@dataclass(frozen=True, slots=True)
class ResultsDirectory:
    """One unit that can be copied: the database and the files of the episodes."""

    path: Path
    database_url: str

    @classmethod
    def locate(
        cls, path: Path | None = None, database_url: str | None = None, environment: Mapping[str, str] = os.environ
    ) -> Self:
        """Return the results directory that a command means; nothing is touched.

        Args:
            path: as given with --results; else $VSNBENCH_RESULTS, else ./results.
            database_url: as given with --db: a database elsewhere; else `vsnbench.db` in the directory.
            environment: the environment's variables.
        """
        where = Path(path or environment.get(ENVIRONMENT_VARIABLE) or BUILT_IN_RESULTS).expanduser()
        return cls(where, database_url or sqlite_url(where / DATABASE_NAME))

    @property
    def options(self) -> str:
        """What another command typed here needs to be told to find the same record, each option after a blank.

        Not where a lab's file says it; where a variable said it, another terminal may not know.
        """
        said = next(each.value for each in lab_defaults(environment={}) if each.name == "results")
        usual = Path(said or BUILT_IN_RESULTS)
        known = self.path == usual == Path(os.environ.get(ENVIRONMENT_VARIABLE) or usual)
        words = "" if known else f" --results {shlex.quote(str(self.path))}"
        elsewhere = self.database_url != sqlite_url(self.path / DATABASE_NAME)
        return words + (f" --db {shlex.quote(self.shown_database)}" if elsewhere else "")

    @property
    def shown_database(self) -> str:
        """The database as it may be printed, without a password."""
        return shown_url(self.database_url)

    def prepare(self) -> None:
        """Make the directory and see that it can be written and has room.

        Raises:
            RecordError: it cannot be used; the message says why.
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
        """Return the space left for an ordinary user on the directory's disk."""
        return shutil.disk_usage(self.path).free

    def episode_directory(self, images_directory: str) -> Path:
        """Return the directory of an episode's files, from what the database says (`episodes/000017`).

        Raises:
            RecordError: what it says leads out of the results directory.
        """
        confined(self.path, images_directory)
        return self.path / images_directory
