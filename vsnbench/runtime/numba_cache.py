"""Compilation of inner loops to machine code, with a cache on disk."""

import logging
from collections.abc import Callable
from functools import cache
from typing import TypeVar

import numba

from vsnbench.files.temporary import private_temporary_directory

logger = logging.getLogger(__name__)
F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compile a function to machine code at its first call, cached per machine.

    The code releases the interpreter's lock and uses one thread. Fast maths is off, because it would change the order
    of sums and make pixels depend on the processor. Division by zero gives infinity or NaN, as in numpy, because a
    check would prevent vectorization. The cache is next to the source, else in $NUMBA_CACHE_DIR, the user's cache
    directory, or a temporary directory of this user. If none is writable, every process compiles again.
    """
    # The wrapper for C callbacks, which nothing here is, would cost a twentieth of the time of compilation.
    options = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    try:
        made: F = numba.njit(**options, cache=True)(function)
    except RuntimeError:  # "cannot cache function: no locator available"
        made = numba.njit(**options, cache=_use_temporary_directory())(function)
    return made


@cache
def _use_temporary_directory() -> bool:
    """Use a temporary directory for compiled code from now on; return whether there is one."""
    directory = private_temporary_directory()
    if directory is None:
        logger.warning(
            "no directory for compiled code can be written: every process of a run compiles it again at its start; "
            "set NUMBA_CACHE_DIR to a directory that can be written"
        )
        return False
    numba.config.CACHE_DIR = str(directory / "compiled")
    return True
