"""Entry point of `vsnbench`: an old Python, or Ctrl-C while it loads, prints one line instead of a traceback."""

import os
import signal
import sys


def main() -> None:
    """Load the command line and run it."""
    if sys.version_info < (3, 11):  # noqa: UP036 - a checkout can be run by any Python
        version = ".".join(map(str, sys.version_info[:3]))
        sys.exit(f"vsnbench: error: needs Python 3.11 or newer; this is Python {version} ({sys.executable})")
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # otherwise the parent process ignores it
        signal.signal(signal.SIGINT, _stop_before_start)
    from vsnbench.cli.main import main as command_line

    command_line(_restore_ctrl_c)


def _stop_before_start(number: int, _frame: object) -> None:
    os.write(2, b"\nvsnbench: stopped before the command started\n")
    os._exit(128 + number)


def _restore_ctrl_c() -> None:
    """Raise KeyboardInterrupt on Ctrl-C again, so that the command can clean up."""
    if signal.getsignal(signal.SIGINT) is _stop_before_start:
        signal.signal(signal.SIGINT, signal.default_int_handler)


if __name__ == "__main__":
    main()
