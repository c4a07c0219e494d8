"""The person beside a robot that nothing else can place: asked to put it down, to look, and to measure.

Nothing that is typed by accident is a verdict: Enter alone asks again, a collision and a distance far from the estimate
are asked back. Whoever is not sure says `later`, and the episode awaits judgement (`vsnbench judge`); so it does when
the terminal hangs up or Ctrl-C ends the session at a question.
"""

import contextlib
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from typing import Protocol, TypeVar

from rich.console import Console
from rich.markup import escape

from vsnbench.errors import UsageError
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.persons_word import collided, taped
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import StartingPosition
from vsnbench.runner.answers import MisreadError, Said, confirmed, measured_m, what_was_touched
from vsnbench.runner.attendant import Display, EndedEpisode, Judgement, Nobody
from vsnbench.runner.emergency_stop import EmergencyStop
from vsnbench.runner.placing import Placing
from vsnbench.runner.stopping import StopAuthor, Stopped, Stopping, StopRequest, leave_dead_terminal
from vsnbench.runner.terminal_placing import check_at_terminal

Answer = TypeVar("Answer")

SURPRISE_M = 1.0
"""A measured distance that differs from the estimate by more is asked back."""


class TerminalDisplay(Display, Protocol):
    """A display that makes room for a question."""

    console: Console

    def paused(self) -> AbstractContextManager[None]:
        """Take the progress bar away while a person types."""
        ...


def require_operator(profile: RobotProfile) -> None:
    """Make sure that somebody can be asked.

    Raises:
        UsageError: there is no terminal.
    """
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError(
            f"{profile.name} must be put at each starting position by a person, and there is no terminal to ask one",
            advice="run in a terminal, or with --unattended (the episodes then await judgement: "
            "`vsnbench judge --pending`)",
        )


def forget_typed() -> None:
    """Drop what was typed before a question is put: keys pressed while the robot drove are no answer to it."""
    import termios

    with contextlib.suppress(OSError, ValueError, termios.error):
        if sys.stdin.isatty():
            termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)


def read_terminal() -> str:
    """Return the next line that is typed.

    Raises:
        EOFError: nobody is at the terminal any more.
    """
    try:
        line = sys.stdin.readline()
    except OSError as error:
        raise EOFError from error
    if not line:
        raise EOFError
    return line


class Operator(Nobody):
    """A person at the terminal."""

    def __init__(
        self,
        display: TerminalDisplay,
        emergency: EmergencyStop,
        stop: Stopping,
        read_line: Callable[[], str] = read_terminal,
    ) -> None:
        super().__init__(display)
        self._console = display.console
        self._paused = display.paused
        self._emergency = emergency
        self._stop = stop
        self._read_line = read_line

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Name the starting position and wait for Enter."""
        x, y = start.position
        where = f"x {x:.2f} m, y {y:.2f} m, facing {start.heading_deg:g}°"
        with self._emergency.off(), self._paused():
            if problem:
                self._console.print(f"[yellow]not yet[/yellow]: {escape(problem)}")
            note = f" ({start.note})" if start.note else ""
            self._console.print(
                f"Put the robot at [bold]starting position {start.number}[/bold]: {where}{escape(note)}"
            )
            self._ask("Enter when it stands there (Ctrl-C ends the session): ")
            check_at_terminal(placing, self._console, self._ask)
        self._console.print("[dim]driving; the space bar stops the robot and ends this episode[/dim]")

    def judge(self, ended: EndedEpisode) -> Judgement | None:
        """Ask what the robot touched and how far it is from the goal; None for later."""
        judgement: Judgement | None = None
        try:
            with self._emergency.off(), self._paused():
                judgement = self._asked(ended)
        finally:
            if judgement is None:
                self._console.print(
                    f"\n[yellow]#{ended.number} awaits judgement[/yellow]: vsnbench judge {ended.number}"
                )
        if judgement is not None:
            self._display.judged(judgement.verdict.success)
            self._console.print(f"[dim]#{ended.number} judged by you:[/dim] {escape(judgement.verdict.text)}")
        return judgement

    def _asked(self, ended: EndedEpisode) -> Judgement | None:
        proposed, outcome, plan = ended.outcome.verdict, ended.outcome, ended.plan
        if proposed.end_reason is EndReason.COLLISION:
            there_was = self._until("The robot felt a collision. Was there one? (yes / later): ", confirmed)
            return Judgement(proposed) if there_was else None
        touched = self._touched()
        if touched is Said.LATER:
            return None
        if isinstance(touched, str):
            seen = collided(touched, outcome.actions, proposed.distance, plan.parameters)
            return Judgement(seen, note=touched, called_collision=True)
        return self._measured(ended) if proposed.end_reason is EndReason.STOP else Judgement(proposed)

    def _touched(self) -> Said | str:
        while True:
            told = self._until("Did it touch anything? (no / what / later): ", what_was_touched)
            if isinstance(told, Said) or self._is_sure(f"A collision with {told!r}: the episode has failed"):
                return told

    def _measured(self, ended: EndedEpisode) -> Judgement | None:
        plan, proposed = ended.plan, ended.outcome.verdict
        estimate = proposed.distance
        if estimate is None:
            raise ValueError("an episode that ended with STOP has a distance to the goal")
        question = f"Metres by tape to the nearest {plan.goal}? (0.84 / keep {estimate.distance_m:.2f} / later): "
        while True:
            told = self._until(question, partial(measured_m, site=plan.site))
            if isinstance(told, Said):
                return None if told is Said.LATER else Judgement(proposed)
            far_off = abs(told - estimate.distance_m) > SURPRISE_M
            if not far_off or self._is_sure(f"{told:.2f} m, and odometry says {estimate.distance_m:.2f} m"):
                return Judgement(taped(EndReason.STOP, ended.outcome.actions, told, estimate.instance, plan.parameters))

    def _is_sure(self, of: str) -> bool:
        return self._until(f"{of}. Is that right? (yes / no): ", confirmed)

    def _until(self, question: str, read: Callable[[str], Answer]) -> Answer:
        """Ask until the answer can be taken."""
        while True:
            try:
                return read(self._ask(question))
            except MisreadError as error:
                self._console.print(f"[yellow]{escape(str(error))}[/yellow]")

    def _ask(self, question: str) -> str:
        """Return what is typed; Ctrl-C, a hang-up and an end of the input act here.

        Raises:
            Stopped: nobody answers any more.
        """
        with self._stop.interruptible():
            try:
                forget_typed()
                self._console.print(question, end="", markup=False, soft_wrap=True)
                return self._read_line()
            except (EOFError, OSError):
                leave_dead_terminal()
                raise Stopped(StopRequest(StopAuthor.SYSTEM, "a terminal that was closed", exit_code=129)) from None
