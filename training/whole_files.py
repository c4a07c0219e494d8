"""Writes what training keeps: whole or not at all, and flushed to the disk before it gets its name."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from vsnbench.errors import VsnbenchError
from vsnbench.whole_files import whole_file


class TrainingError(VsnbenchError):
    """A training run that cannot go on; what it had finished is kept, and the same command goes on from there."""


def write_whole(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Let `write` fill a file; nothing appears under `path` before all of it is on the disk.

    Raises:
        TrainingError: the disk is full or cannot be written; whatever was at `path` before is still there.
    """
    try:
        with whole_file(path, TrainingError) as part, part.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
    except RuntimeError as error:  # PyTorch's writer reports a full disk as one
        reason = str(error).partition("\n")[0]
        raise TrainingError(f"cannot write {path}: {reason}; make room and run the same command again") from error
