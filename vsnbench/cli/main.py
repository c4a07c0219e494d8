"""The console script: which verbs there are, and the one place where errors become a line and an exit code.

A verb's module is imported only when that verb is called, so that `vsnbench --help` answers at once.
"""

import atexit
import gc
import importlib
import logging
import os
import sys
from collections.abc import Callable, Sequence
from typing import Annotated

import typer
from typer.main import get_command

from vsnbench import __version__
from vsnbench.cli.options import refuse_repeated
from vsnbench.cli.output import WITHOUT_RESULT, flowing, hushable
from vsnbench.cli.refusals import RefusingGroup
from vsnbench.errors import VsnbenchError
from vsnbench.lab_file import LabDefault, take_lab_defaults

VERBS: dict[str, tuple[str, str]] = {
    "run": ("vsnbench.cli.run", "Run a campaign: one model, its goals, every starting position; resumes by itself."),
    "study": ("vsnbench.cli.study", "An experiment: several models, a locked plan, run blind, judged as said before."),
    "report": ("vsnbench.cli.report", "Success rates with intervals, from the database."),
    "compare": ("vsnbench.cli.compare", "Compare two models with honest statistics."),
    "view": ("vsnbench.cli.view", "Open an episode in Rerun."),
    "judge": ("vsnbench.cli.judge", "Say what became of an episode: confirm, measure, amend, void."),
    "episodes": ("vsnbench.cli.episodes", "List and show recorded episodes."),
    "sites": ("vsnbench.cli.sites", "List, show, check and draw sites."),
    "robots": ("vsnbench.cli.robots", "List, show and check robot profiles."),
    "models": ("vsnbench.cli.models", "Begin, list, show, check, serve and fetch models."),
    "ros1": ("vsnbench.cli.ros1", "The ROS 1 nodes: discrete_move, and a simulated robot to rehearse with."),
    "ros2": ("vsnbench.cli.ros2", "The ROS 2 nodes: discrete_move, and a simulated robot to rehearse with."),
    "doctor": ("vsnbench.cli.doctor", "Check a robot, its topics and this machine before a session."),
    "place": ("vsnbench.cli.place", "Measure how far off its mark a robot stands, before it drives."),
    "export": ("vsnbench.cli.export", "Write episodes in the formats of other tools."),
    "import": ("vsnbench.cli.import_", "Take in results of other tools."),
    "init": ("vsnbench.cli.init", "Make a directory for a lab's work: its defaults, a site to fill."),
    "config": ("vsnbench.cli.config", "Show a lab's defaults, and where each comes from."),
    "db": ("vsnbench.cli.db", "The results database: its state, upgrade, backup and merge."),
}
"""Verb -> (module, line for --help), in the order of --help.

A module offers `app` (a Typer with sub-commands) or `command` (a function that is the verb itself).
"""

_SAID_ALOUD = {
    ("run",): ("site", "robot"),
    ("doctor",): ("robot",),
    ("place",): ("site", "robot"),
    ("sites", "scan"): ("robot",),
    ("study", "new"): ("site", "robot"),
    ("ros1", "simulate"): ("site",),
    ("ros2", "simulate"): ("site",),
}
"""Verbs that may move a robot, or plan it -> which defaults of a file they name, so that nobody is surprised."""

_COMPLETING = "_VSNBENCH_COMPLETE"
"""Set by a shell that asks what could come next."""

ALIASES = {"ros": "ros1"}
"""Older name of a verb -> the verb; understood, and not shown."""

EXAMPLES = """
[bold]Does the model find chairs?[/bold]

    vsnbench run --model pirlnav --goal chair
    vsnbench report
    vsnbench view 1

With no robot named, a simulated Turtlebot 2 drives in an embedded apartment.
Results go to ./results, or where --results or $VSNBENCH_RESULTS says.
Interrupted? The same command goes on with the trials that are left.
"""

EXIT_CODES = """
[bold]Exit codes[/bold]: 0 done; 1 it could not, a check failed, or trials are left;
2 what was typed does not fit; ended from outside: 129 a closed terminal,
130 Ctrl-C or the emergency stop, 143 SIGTERM.

Every verb that prints a result knows --json and --quiet.
"""


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"vsnbench {__version__}")
        raise typer.Exit


def build_app(verb: str | None) -> typer.Typer:
    """Return the command line with `verb` loaded in full and every other verb as its one line of help."""
    root = typer.Typer(
        name="vsnbench",
        cls=RefusingGroup,
        help=f"Benchmark visual-semantic-navigation models on robots, real and simulated.\n\n{EXAMPLES}",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        epilog=EXIT_CODES,
        rich_markup_mode="rich",
        context_settings={"help_option_names": ["-h", "--help"]},
    )

    @root.callback()
    def options(
        version: Annotated[
            bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
        ] = False,
    ) -> None:
        del version

    shown = ALIASES.get(verb, verb) if verb else None
    for name, (module_name, summary) in VERBS.items():
        if name != shown:
            root.command(name, help=summary)(lambda: None)
            continue
        module = importlib.import_module(module_name)
        if hasattr(module, "app"):
            for command in module.app.registered_commands:
                own_name = command.name or command.callback.__name__
                if (name, own_name) not in WITHOUT_RESULT:
                    command.callback = hushable(command.callback)
                command.help = flowing(command.help or command.callback.__doc__)
            root.add_typer(module.app, name=verb, help=flowing(module.app.info.help) or summary)
        else:
            root.command(verb, help=flowing(module.command.__doc__))(hushable(module.command))
    return root


def main(loaded: Callable[[], object] = lambda: None) -> None:
    """Run the command line; known errors become one line on stderr and their exit code.

    Args:
        loaded: called when the verb that was typed is loaded, and has not begun.
    """
    # Python walks through everything that lives before it ends: a second of work where models are loaded, and many on a
    # loaded machine. What has to be closed is closed by then.
    atexit.register(gc.freeze)
    logging.basicConfig(level=logging.WARNING, format="vsnbench: %(levelname)s: %(message)s", stream=sys.stderr)
    completing = _COMPLETING in os.environ
    verb = next((word for word in _typed() if word in VERBS or word in ALIASES), None)
    try:
        taken = [] if verb == "config" or completing else take_lab_defaults()
        app = build_app(verb)
        refuse_repeated(get_command(app), sys.argv[1:])
        _say_defaults(verb, taken)
        loaded()
        app(prog_name="vsnbench")
    except VsnbenchError as error:
        sys.stderr.write(f"vsnbench: error: {error}\n")
        sys.exit(error.exit_code)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(0)
    except Exception:
        if not (fault := _record_fault()):
            raise
        sys.stderr.write(f"vsnbench: error: {fault}\n")
        sys.exit(VsnbenchError.exit_code)


def _typed() -> Sequence[str]:
    """Return the words of the command line; while a shell asks what could come next, those that stand there so far."""
    if _COMPLETING not in os.environ:
        return sys.argv[1:]
    return (os.environ.get("_TYPER_COMPLETE_ARGS") or os.environ.get("COMP_WORDS") or "").split()[1:]


def _say_defaults(verb: str | None, taken: Sequence[LabDefault]) -> None:
    """Name the defaults of a lab's file that decide what a robot does."""
    typed = {word.split("=", 1)[0] for word in sys.argv[1:]}
    after = sys.argv[sys.argv.index(verb) + 1 :][:1] if verb in sys.argv else []
    named = _SAID_ALOUD.get((verb or "",)) or _SAID_ALOUD.get((verb or "", *after), ())
    said = [
        f"{each.name} {each.value}"
        for each in taken
        if each.name in named and not typed & {f"--{each.name}", f"--{each.name}s", "--help", "-h"}
    ]
    if said:
        sys.stderr.write(f"{', '.join(said)} (from {taken[0].source})\n")


def _record_fault() -> str:
    """Return what is wrong with the record, where an unexpected failure is not ours; empty for a bug of ours."""
    if "vsnbench.database.engine" not in sys.modules:
        return ""
    from vsnbench.database.soundness import fault_of_opened_records

    return fault_of_opened_records()


if __name__ == "__main__":
    main()
