"""Runs a stress test from the terminal, and prints, writes and draws its result."""

from pathlib import Path

from vsnbench.cli.running.summary import stopped_message, summary_console
from vsnbench.cli.running.sweep_summary import print_sweep_summary, run_planned, sweep_console
from vsnbench.cli.support.output import is_quiet
from vsnbench.errors import UsageError
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.setup.sweep import Sweep, undone
from vsnbench.runner.stopping.requests import Stopped

_FORMATS = (".svg", ".pdf", ".png")


def check_figure(path: Path | None) -> None:
    """Check the file of `--figure` before trials are run.

    Raises:
        UsageError: no figure can be written there.
    """
    if path is None:
        return
    if path.suffix not in _FORMATS:
        raise UsageError(f"--figure {path}: unknown format", advice="name a .svg, .pdf or .png file", code="bad-figure")
    if not path.absolute().parent.is_dir():
        raise UsageError(f"--figure {path}: the directory does not exist", advice="create it first", code="bad-figure")


def run_stress(sweep: Sweep, request: RunRequest, figure: Path | None, *, as_json: bool) -> int:
    del figure
    """Run a stress test and return the exit code: 0 if every trial is done, 1 if some are left, 129 to 143 if stopped.

    Args:
        sweep: every campaign under every condition.
        request: options that they share.
        figure: file of the figure.
        as_json: print the result as JSON.
    """
    try:
        swept = run_planned(sweep, request)
    except Stopped as stopped:
        sweep_console().print(stopped_message(stopped))
        return stopped.request.exit_code
    if not (as_json and is_quiet()):
        print_sweep_summary(summary_console(), swept, request.results)
    return 1 if any(undone(swept)) else 0
