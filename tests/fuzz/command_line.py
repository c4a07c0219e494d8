"""The command line within this process, with its own error boundary."""

import sys

from vsnbench.cli.main import main


def call(*words: str) -> int:
    """Run a command and return its exit code; what passes its boundary is raised."""
    before = sys.argv
    sys.argv = ["vsnbench", *words]
    try:
        main()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        sys.argv = before
    return 0
