"""Log level of stderr: warnings, or more with --verbose or $VSNBENCH_LOG_LEVEL."""

import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from vsnbench.errors import UsageError

VARIABLE = "VSNBENCH_LOG_LEVEL"
"""Environment variable; worker processes inherit it."""
LEVELS = ("debug", "info", "warning", "error")


def set_up_logging() -> None:
    """Log to stderr, at the level of the environment variable.

    Raises:
        UsageError: the variable has an unknown level.
    """
    logging.basicConfig(level=logging.WARNING, format="vsnbench: %(levelname)s: %(message)s", stream=sys.stderr)
    level = os.environ.get(VARIABLE, "").lower()
    if not level:
        return
    if level not in LEVELS:
        raise UsageError(f"{VARIABLE}={level} is not a log level", advice=f"use one of {', '.join(LEVELS)}")
    logging.getLogger("vsnbench").setLevel(level.upper())


@contextmanager
def verbose(count: int) -> Iterator[None]:
    """Log more while this is entered: 1 for the level info, 2 or more for debug."""
    if not count:
        yield
        return
    logger, before = logging.getLogger("vsnbench"), os.environ.get(VARIABLE)
    level = logger.level
    os.environ[VARIABLE] = "info" if count == 1 else "debug"
    logger.setLevel(os.environ[VARIABLE].upper())
    try:
        yield
    finally:
        logger.setLevel(level)
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before
