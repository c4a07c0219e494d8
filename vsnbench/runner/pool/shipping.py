"""A bench plan for a machine that shares no disk with this one: what it names as files goes along, by content."""

import hashlib
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vsnbench.errors import UsageError
from vsnbench.runner.bench import BenchPlan
from vsnbench.whole_files import write_whole

_SIMULATED = "simulated:"


@dataclass(frozen=True, slots=True)
class ShippedFile:
    """A file that goes along."""

    name: str
    """Without its directory: a checkpoint's name is part of what the record calls it."""
    content: bytes

    @classmethod
    def of(cls, path: Path) -> "ShippedFile":
        """Read a file.

        Raises:
            UsageError: it is a directory, or cannot be read.
        """
        try:
            return cls(path.name, path.read_bytes())
        except OSError as error:
            raise UsageError(
                f"{path} cannot go to the cluster: {error.strerror}",
                advice="name a single file, or install it on every node",
            ) from error

    def unpacked(self) -> Path:
        """Return where it lies on this machine, whole and once, for this user only."""
        directory = Path(tempfile.gettempdir()) / f"vsnbench-shipped-{os.getuid()}"
        directory.mkdir(mode=0o700, exist_ok=True)
        if directory.is_symlink() or directory.stat().st_uid != os.getuid():
            raise UsageError(f"{directory} is somebody else's", advice="remove it on that node")
        path = directory / hashlib.sha256(self.content).hexdigest() / self.name
        if not path.is_file() or path.read_bytes() != self.content:
            write_whole(path, self.content)
        return path


@dataclass(frozen=True, slots=True)
class ShippedPlan:
    """A bench plan with its files."""

    plan: BenchPlan
    options: Mapping[str, ShippedFile]
    """The model's options that are files."""
    profile: ShippedFile | None
    """The simulated robot's profile, where that is a file."""

    @classmethod
    def of(cls, plan: BenchPlan) -> "ShippedPlan":
        """Pack a plan.

        Raises:
            UsageError: a file cannot be read.
        """
        options = {
            name: ShippedFile.of(value)
            for name, value in plan.model_options.items()
            if isinstance(value, Path) and value.exists()
        }
        profile = Path(plan.robot.removeprefix(_SIMULATED))
        return cls(plan, options, ShippedFile.of(profile) if profile.is_file() else None)

    def unpacked(self) -> BenchPlan:
        """Return the plan as it reads on this machine."""
        there: dict[str, Any] = {name: file.unpacked() for name, file in self.options.items()}
        robot = f"{_SIMULATED}{self.profile.unpacked()}" if self.profile else self.plan.robot
        return replace(self.plan, model_options={**self.plan.model_options, **there}, robot=robot)
