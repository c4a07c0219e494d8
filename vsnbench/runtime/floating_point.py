"""Floating-point environment of a thread: rounding mode, and whether subnormal numbers are zero.

Code of a model can change it, and then every later result of this thread has other last bits.
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager

_LARGEST_ENVIRONMENT_BYTES = 512
"""Of C's fenv_t; 32 bytes on x86-64."""
_mathematics = ctypes.CDLL(None)
_initial = ctypes.create_string_buffer(_LARGEST_ENVIRONMENT_BYTES)
_mathematics.fegetenv(_initial)


@contextmanager
def floating_point_restored() -> Iterator[None]:
    """Restore the environment that the process began with at the end of the block."""
    try:
        yield
    finally:
        _mathematics.fesetenv(_initial)
