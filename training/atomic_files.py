"""Atomic files of training, flushed to disk before they get their names."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from vsnbench.errors import VsnbenchError
from vsnbench.files.atomic import atomic_file


class TrainingError(VsnbenchError):
    """Error that ends a training run; finished stages are kept, and the same command resumes it."""


def write_atomic(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Write a file with `write`; it appears at `path` only when all of it is on disk.

    Raises:
        TrainingError: the disk is full or not writable; an existing file at `path` is unchanged.
    """
    try:
        with atomic_file(path, TrainingError) as part, part.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
    except RuntimeError as error:  # PyTorch's writer raises RuntimeError for a full disk
        reason = str(error).partition("\n")[0]
        raise TrainingError(f"cannot write {path}: {reason}; make room and run the same command again") from error
