"""Cache on disk of results that depend only on a site or a model.

A cache is optional: if it cannot be read or written, or its content is not valid, the result is computed again without
a message. Nothing in it is executed, and `rm -r ~/.cache/vsnbench` is always safe.
"""

import fcntl
import hashlib
import io
import logging
import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.files.atomic import write_atomic
from vsnbench.files.home import expanded
from vsnbench.files.temporary import private_temporary_directory

logger = logging.getLogger(__name__)

_MOST_FILES = 200
"""Maximum number of entries of one kind; the least recently used are removed."""
_PATIENCE_S = 60.0
_MOST_BYTES = 256 * 2**20


def cache_directory() -> Path:
    """Return this machine's cache directory: `vsnbench` in $XDG_CACHE_HOME or ~/.cache.

    If it is not writable, one in `private_temporary_directory` replaces it, so that the processes of a run still share
    results.

    Raises:
        UsageError: neither a home directory nor a temporary directory exists.
    """
    try:
        usual = expanded(os.environ.get("XDG_CACHE_HOME") or "~/.cache") / "vsnbench"
    except UsageError:
        if (private := private_temporary_directory()) is None:
            raise
        return private / "cache"
    if can_write(usual) or (private := private_temporary_directory()) is None:
        return usual
    return private / "cache"


def can_write(directory: Path) -> bool:
    """Return whether this process can write to a directory or create it."""
    existing = next((path for path in (directory, *directory.absolute().parents) if os.path.lexists(path)), None)
    return existing is not None and existing.is_dir() and os.access(existing, os.W_OK | os.X_OK)


def key_of(*parts: Any) -> str:
    """Return a hash of the inputs of a result: arrays by their bytes, other values by their `repr`."""
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype.str}{part.shape}".encode())
            digest.update(np.ascontiguousarray(part).data)
        else:
            digest.update(repr(part).encode())
        digest.update(b"\0")
    return digest.hexdigest()


@cache
def code_key(*files: str) -> str:
    """Return a hash of source files and of numpy's version, so that other code does not find the result."""
    return key_of(np.__version__, *(Path(file).read_bytes() for file in files))


def cached_array(
    kind: str, key: str, dtype: npt.DTypeLike, shape: tuple[int, ...], make: Callable[[], npt.NDArray[Any]]
) -> npt.NDArray[Any]:
    """Return an array from the cache, or compute and store it; one process computes it while others wait.

    Args:
        kind: kind of result; a subdirectory of the cache.
        key: hash of all inputs.
        dtype: type of the array; other types are rejected.
        shape: shape of the array; other shapes are rejected.
        make: computes the array.
    """
    found = found_array(kind, key, dtype, shape)
    if found is not None:
        return found
    path = cache_directory() / kind / f"{key}.npy"
    with _one_at_a_time(path):
        found = found_array(kind, key, dtype, shape)
        if found is None:
            found = make()
            _keep(path, found)
    return found


def found_array(kind: str, key: str, dtype: npt.DTypeLike, shape: tuple[int, ...]) -> npt.NDArray[Any] | None:
    """Return an array from the cache; None if it is missing or not valid."""
    found = _read(cache_directory() / kind / f"{key}.npy")
    return found if found is not None and (found.dtype, found.shape) == (np.dtype(dtype), shape) else None


@contextmanager
def _one_at_a_time(path: Path) -> Iterator[None]:
    """Lock a result of the cache, with a limited wait. If the directory is not writable, nothing is locked.

    Results whose keys begin alike share a lock, so that there are 16 lock files per kind.
    """
    with ExitStack() as stack:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            lock = stack.enter_context(path.parent.with_name(f".{path.parent.name}-{path.name[0]}.lock").open("a"))
        except OSError as error:
            logger.debug("no cache: %s", error)
        else:
            give_up_s = time.monotonic() + _PATIENCE_S
            while not _locked(lock) and time.monotonic() < give_up_s:
                time.sleep(0.05)
        yield


def _locked(lock: IO[str]) -> bool:
    """Try to take a lock, which ends with the process."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _read(path: Path) -> npt.NDArray[Any] | None:
    """Return a stored array if the file contains nothing else."""
    try:
        if path.stat().st_size > _MOST_BYTES:
            return None
        content = path.read_bytes()
        if hashlib.sha256(content[32:]).digest() != content[:32]:
            return None
        array: npt.NDArray[Any] = np.load(io.BytesIO(content[32:]), allow_pickle=False)
        os.utime(path)
    except (OSError, ValueError, EOFError, MemoryError) as error:
        logger.debug("not from the cache: %s", error)
        return None
    return array


def _keep(path: Path, array: npt.NDArray[Any]) -> None:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    content = buffer.getvalue()
    if len(content) + 32 > _MOST_BYTES:
        return
    try:
        write_atomic(path, hashlib.sha256(content).digest() + content, VsnbenchError)
        used = sorted(path.parent.glob("*.npy"), key=lambda file: file.stat().st_mtime)
        for old in used[:-_MOST_FILES]:
            old.unlink(missing_ok=True)
    except (OSError, VsnbenchError) as error:
        logger.debug("not kept: %s", error)
