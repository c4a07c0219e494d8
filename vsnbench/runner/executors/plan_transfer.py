"""Packs a trial setup's spec with its files, for machines without access to this disk."""

import hashlib
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vsnbench.errors import UsageError
from vsnbench.files.atomic import write_atomic
from vsnbench.files.temporary import private_temporary_directory
from vsnbench.runner.setup.trial_setup import TrialSetupSpec

_SIMULATED = "simulated:"


@dataclass(frozen=True, slots=True)
class PackedFile:
    """A file and its content."""

    name: str
    """Without its directory. The name of a checkpoint is part of its label in the results."""
    content: bytes

    @classmethod
    def of(cls, path: Path) -> "PackedFile":
        """Read a file.

        Raises:
            UsageError: the path is a directory or cannot be read.
        """
        try:
            return cls(path.name, path.read_bytes())
        except OSError as error:
            raise UsageError(
                f"{path} cannot be sent to the cluster: {error.strerror}",
                advice="give a single file, or install it on every node",
                code="unreadable-file",
            ) from error

    def unpacked(self) -> Path:
        """Write the file once on this machine, readable for this user only, and return its path."""
        directory = private_temporary_directory()
        if directory is None:
            raise UsageError(
                f"{tempfile.gettempdir()}/vsnbench-{os.getuid()} cannot be used: it cannot be written to, or others "
                "can enter it",
                advice="set TMPDIR on that node to a directory that only this user can enter",
                code="foreign-directory",
            )
        path = directory / "shipped" / hashlib.sha256(self.content).hexdigest() / self.name
        if not path.is_file() or path.read_bytes() != self.content:
            write_atomic(path, self.content)
        return path


@dataclass(frozen=True, slots=True)
class PackedSpec:
    """The spec of a trial setup with its files."""

    spec: TrialSetupSpec
    options: Mapping[str, PackedFile]
    """Options of the model that are files."""
    profile: PackedFile | None
    """Profile of the simulated robot, if it is a file."""

    @classmethod
    def of(cls, spec: TrialSetupSpec) -> "PackedSpec":
        """Pack a spec.

        Raises:
            UsageError: a file cannot be read.
        """
        options = {
            name: PackedFile.of(value)
            for name, value in spec.options.items()
            if isinstance(value, Path) and value.exists()
        }
        profile = Path(spec.robot.removeprefix(_SIMULATED))
        return cls(spec, options, PackedFile.of(profile) if profile.is_file() else None)

    def unpacked(self) -> TrialSetupSpec:
        """Return the spec with paths on this machine."""
        options: dict[str, Any] = {name: file.unpacked() for name, file in self.options.items()}
        robot = f"{_SIMULATED}{self.profile.unpacked()}" if self.profile else self.spec.robot
        return replace(self.spec, model_options={**self.spec.model_options, **options}, robot=robot)
