"""Measures how fast a directory's disk stores data."""

import os
import tempfile
import time
from pathlib import Path

_CHUNK_BYTES = 4 * 2**20
_TIME_LIMIT_S = 0.5
_MOST_CHUNKS = 16


def write_speed(directory: Path) -> float:
    """Return the bytes per second that reach the disk; takes half a second, or one chunk of 4 MiB.

    Raises:
        OSError: the directory cannot be written.
    """
    chunk = os.urandom(_CHUNK_BYTES)
    with tempfile.TemporaryFile(dir=directory, buffering=0) as file:
        began, written = time.perf_counter(), 0
        while written < _MOST_CHUNKS and (written == 0 or time.perf_counter() - began < _TIME_LIMIT_S):
            file.write(chunk)
            os.fsync(file.fileno())
            written += 1
        return written * len(chunk) / (time.perf_counter() - began)
