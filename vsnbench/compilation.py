"""How inner loops are compiled to machine code, and where it is kept."""

import logging
from collections.abc import Callable
from functools import cache
from typing import TypeVar

import numba

logger = logging.getLogger(__name__)
F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compile a function to machine code at its first call, once a machine.

    It releases the interpreter's lock and stays on one thread. Fast maths is off: it would reorder sums, and pixels
    would differ from one processor to the next. A division by zero is infinite or not a number, as in numpy: to look
    for it first would keep loops from taking several numbers at once. The code is kept beside the source, else in the
    user's cache directory or in $NUMBA_CACHE_DIR; where none of them can be written, it is compiled anew by every
    process.
    """
    try:
        made: F = numba.njit(nogil=True, error_model="numpy", cache=True)(function)
    except RuntimeError:  # "cannot cache function: no locator available"
        _tell_of_no_cache()
        made = numba.njit(nogil=True, error_model="numpy")(function)
    return made


@cache
def _tell_of_no_cache() -> None:
    """Say once what it costs."""
    logger.warning(
        "no directory for compiled code can be written: every start compiles it anew, some 20 s; "
        "set NUMBA_CACHE_DIR to a directory of yours"
    )
