"""How the inner loops of map and planner are compiled."""

from collections.abc import Callable
from typing import TypeVar

import numba

F = TypeVar("F", bound=Callable[..., object])


def kernel(function: F) -> F:
    """Compile a function to machine code, once a machine; it stays on one thread and keeps the order of sums."""
    compiled: F = numba.njit(nogil=True, cache=True)(function)
    return compiled
