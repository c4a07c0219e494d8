"""Writes files whole or not at all: to a temporary name, flushed to the disk, then renamed."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from vsnbench.errors import VsnbenchError


class TrainingError(VsnbenchError):
    """A training run that cannot go on; what it had finished is kept, and the same command goes on from there."""


def write_whole(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Let `write` fill a file; nothing appears under `path` before all of it is on the disk.

    Raises:
        TrainingError: the disk is full or cannot be written; whatever was at `path` before is still there.
    """
    half = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with half.open("wb") as file:
                write(file)
                file.flush()
                os.fsync(file.fileno())
            half.replace(path)
        finally:
            half.unlink(missing_ok=True)
    except (OSError, RuntimeError) as error:  # PyTorch's writer reports a full disk as a RuntimeError
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error).partition("\n")[0]
        raise TrainingError(f"cannot write {path}: {reason}; make room and run the same command again") from error


def sweep(directory: Path) -> None:
    """Remove what killed processes left half written."""
    for half in directory.rglob(".*.*"):
        owner = half.name.rpartition(".")[2]
        if half.is_file() and owner.isdigit() and not Path(f"/proc/{owner}").exists():
            half.unlink(missing_ok=True)
