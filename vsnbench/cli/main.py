"""Console script: loads the module of a command when it is called, and turns errors into one line and an exit code."""

import atexit
import gc
import importlib
import logging
import os
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.main import get_command

from vsnbench import __version__
from vsnbench.cli.support.completion import add_completion
from vsnbench.cli.support.output import WITHOUT_RESULT, LogFile, Verbose, join_long_lines, with_output_options
from vsnbench.cli.support.parser_errors import RootGroup
from vsnbench.cli.support.words import mark_missing_values, refuse_empty_directories, refuse_repeated
from vsnbench.config import ConfigDefault, apply_config_defaults
from vsnbench.errors import VsnbenchError
from vsnbench.runtime.garbage import collect_rarely
from vsnbench.text.log_output import LogOutput, log_more, opened_log
from vsnbench.text.sanitize import memory_problem, sanitize
from vsnbench.text.streams import sanitized_output

VERBS: dict[str, tuple[str, str]] = {
    "try": ("vsnbench.cli.running.try_", "Check a policy, run two trials, and say what is wrong with it."),
    "run": ("vsnbench.cli.running.run", "Run the trials of a campaign, or resume it."),
    "stress": ("vsnbench.cli.running.stress", "Measure what disturbances of camera and odometry cost a model."),
    "study": ("vsnbench.cli.study.verbs", "Run a blinded comparison of several models from a locked plan."),
    "report": ("vsnbench.cli.results.report", "Report success rates with confidence intervals."),
    "compare": ("vsnbench.cli.results.compare", "Compare the success rates of models."),
    "browse": ("vsnbench.cli.results.browse", "Look at the results in a browser: filter, compare, tag."),
    "view": ("vsnbench.cli.results.view", "Open an episode in Rerun."),
    "judge": ("vsnbench.cli.judging.judge", "Judge an episode: confirm, measure, amend or void."),
    "note": ("vsnbench.cli.results.note", "Add notes and tags to episodes; no verdict changes."),
    "episodes": ("vsnbench.cli.results.episodes", "List and show recorded episodes."),
    "sites": ("vsnbench.cli.sites", "List, show, check, draw and edit sites."),
    "protocol": ("vsnbench.cli.protocol", "List, show and check protocols: the rules of the trials."),
    "robots": ("vsnbench.cli.robots.robots", "List and check robot profiles; run the ROS nodes of a robot."),
    "models": ("vsnbench.cli.models.models", "Create, list, check, serve and fetch models."),
    "doctor": ("vsnbench.cli.robots.doctor", "Check this machine, and a robot, before a session."),
    "place": ("vsnbench.cli.running.place", "Measure how far a robot is from its starting position."),
    "export": ("vsnbench.cli.results.export", "Write episodes in the formats of other tools."),
    "bundle": ("vsnbench.cli.evidence.bundle", "Pack results into one file that another person can check."),
    "import": ("vsnbench.cli.results.import_", "Import results of other tools."),
    "verify": ("vsnbench.cli.evidence.verify", "Verify results: hashes, images, verdicts, report, studies."),
    "init": ("vsnbench.cli.init", "Create a directory with a configuration and a site to edit."),
    "config": ("vsnbench.cli.config", "Show the configuration and where each value comes from."),
    "db": ("vsnbench.cli.results.db", "Inspect, upgrade, back up and merge the results database."),
}
"""Command -> (module, line for --help), in the order of --help.

A module has either `app` (a Typer with subcommands) or `command` (the function of the command).
"""

_PRINTED_DEFAULTS = {
    ("run",): ("site", "robot", "protocol"),
    ("stress",): ("site", "robot", "protocol"),
    ("doctor",): ("robot",),
    ("place",): ("site", "robot"),
    ("study", "new"): ("site", "robot"),
    ("robots", "simulate"): ("site",),
}
"""Commands that may move a robot, or plan it -> configured defaults that they print."""

HELP_OPTIONS = ["-h", "--help"]

_COMPLETING = "_VSNBENCH_COMPLETE"
"""Environment variable that a shell sets to request completions."""

EXAMPLES = """
[bold]Does the model find chairs?[/bold]

    vsnbench run --model pirlnav --goal chair
    vsnbench report
    vsnbench view 1

The default robot is a simulated TurtleBot 2 in an embedded apartment.
Results go to ./results; --results or $VSNBENCH_RESULTS changes that.
After an interruption, the same command resumes.
"""

EXIT_CODES = """
[bold]Exit codes[/bold]: 0 success; 1 failure, failed check or unfinished trials;
2 usage error. Ended by a signal: 129 closed terminal, 130 Ctrl-C or
emergency stop, 143 SIGTERM.

Commands that print a result have --json and --quiet. --verbose and --log-file
work with every command.
"""


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"vsnbench {__version__}")
        raise typer.Exit


def build_app(name: str | None) -> typer.Typer:
    """Return the command line with one command loaded, and only the line of help of the others."""
    root = typer.Typer(
        name="vsnbench",
        cls=RootGroup,
        help=f"Benchmark visual-semantic-navigation models on real and simulated robots.\n\n{EXAMPLES}",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        epilog=EXIT_CODES,
        rich_markup_mode="rich",
        context_settings={"help_option_names": HELP_OPTIONS},
    )

    @root.callback()
    def options(
        version: Annotated[
            bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
        ] = False,
        verbosity: Verbose = 0,
        log_file: LogFile = None,
    ) -> None:
        del version
        log_more(verbosity, log_file)

    for other, (module_name, summary) in VERBS.items():
        if other != name:
            root.command(other, help=summary)(lambda: None)
            continue
        module = importlib.import_module(module_name)
        if hasattr(module, "app"):
            for command in module.app.registered_commands:
                add_completion(name, command.callback)
                own_name = command.name or command.callback.__name__
                has_result = (name, own_name) not in WITHOUT_RESULT
                command.callback = with_output_options(command.callback, has_result=has_result)
                command.help = join_long_lines(command.help or command.callback.__doc__)
            root.add_typer(module.app, name=name, help=join_long_lines(module.app.info.help) or summary)
        else:
            add_completion(name, module.command)
            command = with_output_options(module.command, has_result=(name,) not in WITHOUT_RESULT)
            root.command(name, help=join_long_lines(module.command.__doc__))(command)
    return root


def hide_flag_types(command: Any) -> None:
    """Remove the value type from the help of every flag of a command and its subcommands."""
    context = command.context_class(command, help_option_names=HELP_OPTIONS)
    for parameter in command.get_params(context):
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
    for subcommand in getattr(command, "commands", {}).values():
        hide_flag_types(subcommand)


def main(loaded: Callable[[], object] = lambda: None) -> None:
    """Run the command line; known errors become one line on stderr and an exit code.

    Args:
        loaded: called when the command is loaded and before it runs.
    """
    collect_rarely()
    # At exit, Python visits every live object: a second if models are loaded. All resources are closed by then.
    atexit.register(gc.freeze)
    with sanitized_output():
        _run(loaded)


def _run(loaded: Callable[[], object]) -> None:
    try:
        with opened_log(_describe_command) as log, _logged_end(log):
            _run_command(loaded)
    except VsnbenchError as error:
        sys.stderr.write(f"vsnbench: error: {sanitize(str(error))}\n")
        sys.exit(error.exit_code)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(0)
    except Exception as error:
        if not (problem := memory_problem(error) or _record_problem()):
            raise
        sys.stderr.write(f"vsnbench: error: {sanitize(problem)}\n")
        sys.exit(VsnbenchError.exit_code)


def _run_command(loaded: Callable[[], object]) -> None:
    completing = _COMPLETING in os.environ
    name = _verb()
    is_help = not {"--help", "-h", "--version"}.isdisjoint(_words())  # works with an invalid file, too
    applied = [] if name == "config" or completing or is_help else apply_config_defaults()
    command = get_command(build_app(name))
    hide_flag_types(command)
    words = mark_missing_values(sys.argv[1:])
    refuse_empty_directories(words)
    refuse_repeated(command, words)
    _print_defaults(name, applied)
    loaded()
    command(words, prog_name="vsnbench")


def _describe_command() -> str:
    """Return the first message of a log file."""
    from vsnbench.results.database_url import command_without_passwords

    return f"vsnbench {__version__}, Python {platform.python_version()}: {command_without_passwords(sys.argv[1:])}"


@contextmanager
def _logged_end(log: LogOutput) -> Iterator[None]:
    """Write to the log file how the command ends; errors pass."""
    try:
        yield
    except SystemExit as end:
        log.write_to_file(logging.INFO, f"exit code {end.code or 0}")
        raise
    except VsnbenchError as error:
        log.write_to_file(logging.ERROR, f"{error} (code {error.code}, exit code {error.exit_code})")
        raise
    except BaseException:
        log.write_to_file(logging.ERROR, "the command ends with an exception", trace=True)
        raise


def _words() -> Sequence[str]:
    """Return the words of the command line; those typed so far if a shell requests completions."""
    if _COMPLETING not in os.environ:
        return sys.argv[1:]
    return (os.environ.get("_TYPER_COMPLETE_ARGS") or os.environ.get("COMP_WORDS") or "").split()[1:]


def _verb() -> str | None:
    """Return the command that is called; None without a known command."""
    words = _words()
    values = {place + 1 for place, word in enumerate(words) if word == "--log-file"}
    return next((word for place, word in enumerate(words) if word in VERBS and place not in values), None)


def _print_defaults(name: str | None, applied: Sequence[ConfigDefault]) -> None:
    """Print the configured values that decide what a robot does."""
    typed = {word.split("=", 1)[0] for word in sys.argv[1:]}
    following = sys.argv[sys.argv.index(name) + 1 :][:1] if name in sys.argv else []
    printed = _PRINTED_DEFAULTS.get((name or "",)) or _PRINTED_DEFAULTS.get((name or "", *following), ())
    values = [
        f"{default.name} {default.value}"
        for default in applied
        if default.name in printed and not typed & {f"--{default.name}", "--help", "-h"}
    ]
    if values:
        sys.stderr.write(f"{', '.join(values)} (from {applied[0].source})\n")


def _record_problem() -> str:
    """Return what is wrong with the record if that explains an unexpected exception, else an empty string."""
    if "vsnbench.results.schema.engine" not in sys.modules:
        return ""
    from vsnbench.results.reading.integrity import fault_of_opened_records

    return fault_of_opened_records()


if __name__ == "__main__":
    main()
