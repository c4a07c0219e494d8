"""The command `vsnbench` from its first moment: Ctrl-C while it is being loaded is a line, and no traceback."""

import os
import signal


def main() -> None:
    """Load the command line and run it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else whoever started it wants none heard
        signal.signal(signal.SIGINT, _nothing_has_begun)
    from vsnbench.cli.main import main as command_line

    command_line(_listens)


def _nothing_has_begun(number: int, _frame: object) -> None:
    os.write(2, b"\nvsnbench: stopped before anything began\n")
    os._exit(128 + number)


def _listens() -> None:
    """Let Ctrl-C be for the verb, which may have something to put in order."""
    if signal.getsignal(signal.SIGINT) is _nothing_has_begun:
        signal.signal(signal.SIGINT, signal.default_int_handler)


if __name__ == "__main__":
    main()
