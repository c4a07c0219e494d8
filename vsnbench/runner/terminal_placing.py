"""The check of a placing: how far off the robot stands, what to do about it, and go; at the terminal and for a page."""

from collections.abc import Callable

from rich.console import Console
from rich.markup import escape

from vsnbench.protocol.placement import MeasuredPlacement
from vsnbench.runner.answers import MisreadError, Said, may_begin
from vsnbench.runner.desk import Choice, Desk
from vsnbench.runner.placing import Placing

LOOK, TURN, MOVED = "look", "turn", "moved"
"""What may be wished of the run while a robot is placed."""
_STANDS_THERE = "Enter when it stands there (skip / end; Ctrl-C ends at once): "
_QUESTION = "Enter to go; or c check it (again), t turn on the spot and check, m moved it: "
_PROPOSAL = "t to turn on the spot and check; Enter to go all the same; or c check it again, m moved it: "
"""Where one look is not enough."""
_WISHES = {"c": LOOK, "check": LOOK, "t": TURN, "turn": TURN, "m": MOVED, "moved": MOVED}
_SAID = {Said.GO: Choice.GO, Said.LATER: Choice.SKIP, Said.END: Choice.END}


class PlacingFace:
    """One placing as the terminal asks about it, and as what a page wishes is carried out: both by the main thread."""

    def __init__(self, placing: Placing, console: Console, ask: Callable[[str], str], desk: Desk) -> None:
        """Make it.

        Args:
            placing: the robot at its mark.
            console: where to say what is seen.
            ask: puts a question and returns what was typed.
            desk: where what is seen is shown, too.
        """
        self._placing = placing
        self._console = console
        self._ask = ask
        self._desk = desk
        self._stands = False
        desk.board.placing_begins(can_measure=placing.can_measure)

    def typed(self) -> Choice:
        """Ask at the terminal until the robot may go, or the trial is for later, or the session is over.

        Raises:
            Stopped: the person ends the session at once.
        """
        while True:
            answer = self._ask(self._question).strip().lower()
            if self._stands and answer in _WISHES:
                self.wished(_WISHES[answer])
                continue
            try:
                said = _SAID[may_begin(answer)]
            except MisreadError as error:
                self._console.print(f"[yellow]{escape(str(error))}[/yellow]")
                continue
            if said is not Choice.GO or self._stands or not self._placing.can_measure:
                return said
            self.wished(MOVED)

    @property
    def _question(self) -> str:
        if not self._stands:
            return _STANDS_THERE
        measured = self._placing.measured
        return _PROPOSAL if measured is not None and measured.wants_turn else _QUESTION

    def wished(self, what: str) -> None:
        """Look, turn and look, or hear that it was moved and look; and say what was seen.

        Raises:
            Stopped: somebody asked the session to stop.
        """
        board = self._desk.board
        board.looking = what
        self._desk.tell()
        try:
            if what == MOVED:
                self._placing.moved()
            if what == TURN:
                self._console.print("[dim]turning once around …[/dim]")
                look = self._placing.turn()
            else:
                look = self._placing.look()
        finally:
            board.looking = ""
            self._stands = True
            board.look = self._placing.last
            self._desk.tell()
        if look.problem:
            self._console.print(f"[yellow]not measured[/yellow]: {escape(look.problem)}")
        if look.measured is not None:
            say_placement(look.measured, self._console)


def say_placement(measured: MeasuredPlacement, console: Console) -> None:
    """Print a measured placement in two or three lines."""
    color = "green" if measured.within_tolerance else "yellow" if not measured.determined else "red"
    console.print(f"[{color}]{escape(measured.headline)}[/{color}]")
    if measured.advice:
        console.print(f"[bold]→[/bold] {escape(measured.advice)}")
    if measured.differs:
        console.print(f"[yellow]{escape(measured.differs)}[/yellow]")
