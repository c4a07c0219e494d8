"""Help pages: flags are shown without a value type."""

from typing import Any

HELP_OPTIONS = ["-h", "--help"]


def hide_flag_types(command: Any) -> None:
    """Remove the type from the help of every flag of a command and its subcommands.

    Args:
        command: as `typer.main.get_command` returns it.
    """
    context = command.context_class(command, help_option_names=HELP_OPTIONS)
    for parameter in command.get_params(context):
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
    for subcommand in getattr(command, "commands", {}).values():
        hide_flag_types(subcommand)
