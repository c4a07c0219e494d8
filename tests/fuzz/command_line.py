"""Runs the command line in this process, inside its error boundary."""

import sys

from vsnbench.cli.main import main


def call(*words: str) -> int:
    """Run a command and return its exit code; unexpected errors are raised."""
    before = sys.argv
    sys.argv = ["vsnbench", *words]
    try:
        main()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        sys.argv = before
    return 0
