"""What follows from a site or a model alone and took time to work out, kept on this machine for the next process.

A cache is never needed: where it cannot be read or written, or holds anything but what was put there, the work is done
again and nobody is told. Nothing in it is run, and `rm -r ~/.cache/vsnbench` is always safe.
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

from vsnbench.errors import VsnbenchError
from vsnbench.whole_files import write_whole

logger = logging.getLogger(__name__)

_MOST_FILES = 200
"""Of one kind; the ones not used for longest make room."""
_PATIENCE_S = 60.0
_MOST_BYTES = 256 * 2**20


def cache_directory() -> Path:
    """Return where this machine's caches are: `vsnbench` under $XDG_CACHE_HOME, else under ~/.cache."""
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "vsnbench"


def key_of(*parts: Any) -> str:
    """Return a hash of everything that a result depends on: arrays by their bytes, all else by its `repr`."""
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
    """Return a hash of source files and of numpy's version: a result of other code is not found again."""
    return key_of(np.__version__, *(Path(file).read_bytes() for file in files))


def kept_array(
    kind: str, key: str, dtype: npt.DTypeLike, shape: tuple[int, ...], make: Callable[[], npt.NDArray[Any]]
) -> npt.NDArray[Any]:
    """Return an array from the cache, or make it and keep it; of several processes one makes it, and the others wait.

    Args:
        kind: what it is; a folder of the cache.
        key: the hash of all that it follows from.
        dtype: its type; anything else in the cache is not believed.
        shape: its shape, likewise.
        make: works it out.
    """
    found = found_array(kind, key, dtype, shape)
    if found is not None:
        return found
    path = cache_directory() / kind / f"{key}.npy"
    with _one_at_a_time(path.parent):
        found = found_array(kind, key, dtype, shape)
        if found is None:
            found = make()
            _keep(path, found)
    return found


def found_array(kind: str, key: str, dtype: npt.DTypeLike, shape: tuple[int, ...]) -> npt.NDArray[Any] | None:
    """Return an array from the cache; None where it is not there, or is not what it should be."""
    found = _read(cache_directory() / kind / f"{key}.npy")
    return found if found is not None and (found.dtype, found.shape) == (np.dtype(dtype), shape) else None


@contextmanager
def _one_at_a_time(directory: Path) -> Iterator[None]:
    """Hold a folder of the cache, for which others wait a while; without one to write to, nobody waits."""
    with ExitStack() as stack:
        try:
            directory.mkdir(parents=True, exist_ok=True)
            lock = stack.enter_context(directory.with_name(f".{directory.name}.lock").open("a"))
        except OSError as error:
            logger.debug("no cache: %s", error)
        else:
            give_up_s = time.monotonic() + _PATIENCE_S
            while not _locked(lock) and time.monotonic() < give_up_s:
                time.sleep(0.05)
        yield


def _locked(lock: IO[str]) -> bool:
    """Try to hold a lock, which goes with the process."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _read(path: Path) -> npt.NDArray[Any] | None:
    """Return what was kept, if that and nothing else is there."""
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
        write_whole(path, hashlib.sha256(content).digest() + content, VsnbenchError)
        used = sorted(path.parent.glob("*.npy"), key=lambda file: file.stat().st_mtime)
        for old in used[:-_MOST_FILES]:
            old.unlink(missing_ok=True)
    except (OSError, VsnbenchError) as error:
        logger.debug("not kept: %s", error)
