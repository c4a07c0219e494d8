"""Checks a placement: shows the robot's offset and advice, carries out actions, and asks for the go."""

from collections.abc import Callable

from rich.markup import escape

from vsnbench.runner.operator.answers import MisreadError, parse_go
from vsnbench.runner.operator.placing import Placing
from vsnbench.runner.operator.prompts import Choice, OperatorPrompts
from vsnbench.text.terminal import Console
from vsnbench.values.placement import MeasuredPlacement

LOOK, TURN, MOVED = "look", "turn", "moved"
"""Actions that the operator can request while a robot is placed."""
_IN_PLACE = "Enter when it is in place (skip / end; Ctrl-C ends at once): "
_QUESTION = "Enter to go; or c check it (again), t turn around and check, m moved it: "
_PROPOSE_TURN = "t to turn around and check; Enter to go anyway; or c check it again, m moved it: "
"""Asked where one look does not determine the pose."""
_ACTIONS = {"c": LOOK, "check": LOOK, "t": TURN, "turn": TURN, "m": MOVED, "moved": MOVED}


class TerminalPlacing:
    """One placement at the terminal; also carries out the actions that browsers request, in the main thread.

    `ask` prints a question and returns the typed answer.
    """

    def __init__(self, placing: Placing, console: Console, ask: Callable[[str], str], prompts: OperatorPrompts) -> None:
        self._placing = placing
        self._console = console
        self._ask = ask
        self._prompts = prompts
        self._is_in_place = False
        prompts.state.placing_begins(can_measure=placing.can_measure)

    def ask_choice(self) -> Choice:
        """Ask at the terminal until the operator chooses go, skip or end.

        Raises:
            Stopped: the operator stops the session.
        """
        while True:
            answer = self._ask(self._question).strip().lower()
            if self._is_in_place and answer in _ACTIONS:
                self.carry_out(_ACTIONS[answer])
                continue
            try:
                choice = parse_go(answer)
            except MisreadError as error:
                self._console.print(f"[yellow]{escape(str(error))}[/yellow]")
                continue
            if choice is not Choice.GO or self._is_in_place or not self._placing.can_measure:
                return choice
            self.carry_out(MOVED)

    @property
    def _question(self) -> str:
        if not self._is_in_place:
            return _IN_PLACE
        measured = self._placing.measured
        return _PROPOSE_TURN if measured is not None and measured.wants_turn else _QUESTION

    def carry_out(self, action: str) -> None:
        """Measure the robot's pose as requested, and show the result.

        Raises:
            Stopped: a request to stop the session.
        """
        state = self._prompts.state
        state.looking = action
        self._prompts.notify()
        try:
            if action == MOVED:
                self._placing.moved()
            if action == TURN:
                self._console.print("[dim]turning once around …[/dim]")
                look = self._placing.turn()
            else:
                look = self._placing.look()
        finally:
            state.looking = ""
            self._is_in_place = True
            state.look = self._placing.last
            self._prompts.notify()
        if look.problem:
            self._console.print(f"[yellow]not measured[/yellow]: {escape(look.problem)}")
        if look.measured is not None:
            print_placement(look.measured, self._console)


def print_placement(measured: MeasuredPlacement, console: Console) -> None:
    """Print a measured placement in two or three lines."""
    color = "green" if measured.within_tolerance else "yellow" if not measured.determined else "red"
    console.print(f"[{color}]{escape(measured.headline)}[/{color}]")
    if measured.advice:
        console.print(f"[bold]→[/bold] {escape(measured.advice)}")
    if measured.differs:
        console.print(f"[yellow]{escape(measured.differs)}[/yellow]")
