"""The check of a placing at the terminal: how far off the robot stands, what to do about it, and go."""

from collections.abc import Callable

from rich.console import Console
from rich.markup import escape

from vsnbench.protocol.placement import MeasuredPlacement
from vsnbench.runner.placing import Placing

_QUESTION = "Enter to go; or c check it (again), t turn on the spot and check, m moved it: "


def check_at_terminal(placing: Placing, console: Console, ask: Callable[[str], str]) -> None:
    """Look from the mark, say what is seen, and ask until the person says go.

    Args:
        placing: the robot at its mark.
        console: where to say it.
        ask: puts a question and returns what was typed.

    Raises:
        Stopped: the person ends the session.
    """
    placing.moved()
    if not placing.can_measure:
        return
    answer = "c"
    while answer:
        if answer in ("m", "moved"):
            placing.moved()
        if answer in ("t", "turn"):
            console.print("[dim]turning once around …[/dim]")
            placing.turn()
        elif answer in ("c", "check", "m", "moved"):
            placing.look()
        else:
            console.print(f"[yellow]{escape(repr(answer))} is none of them[/yellow]")
        if placing.last is not None:
            if placing.last.problem:
                console.print(f"[yellow]not measured[/yellow]: {escape(placing.last.problem)}")
            if placing.last.measured is not None:
                say_placement(placing.last.measured, console)
        answer = ask(_QUESTION).strip().lower()
        if answer in ("go", "y", "yes"):
            return


def say_placement(measured: MeasuredPlacement, console: Console) -> None:
    """Print a measured placement in two or three lines."""
    color = "green" if measured.within_tolerance else "yellow" if not measured.determined else "red"
    console.print(f"[{color}]{escape(measured.headline)}[/{color}]")
    if measured.advice:
        console.print(f"[bold]→[/bold] {escape(measured.advice)}")
    if measured.differs:
        console.print(f"[yellow]{escape(measured.differs)}[/yellow]")
