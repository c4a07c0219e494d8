"""How the simulator's inner loops are compiled."""

from collections.abc import Callable
from typing import TypeVar

import numba

F = TypeVar("F", bound=Callable[..., object])


def kernel(function: F) -> F:
    """Compile a function to machine code, once a machine.

    It releases the interpreter's lock and stays on one thread. Fast maths is off: it would reorder sums, and pixels
    would differ from one processor to the next.
    """
    compiled: F = numba.njit(nogil=True, cache=True)(function)
    return compiled
