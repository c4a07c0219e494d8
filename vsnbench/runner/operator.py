"""The person beside the robot: asked to put it down, to look, and to measure; at the terminal and at every page.

The first answer counts, wherever it is given. Nothing that is typed by accident is a verdict: Enter alone asks again, a
collision and a distance far from the estimate are asked back. Whoever is not sure says `later`, and the episode awaits
judgement (`vsnbench judge`); so it does when the terminal hangs up or Ctrl-C ends the session at a question.
"""

import contextlib
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol, TypeVar

from rich.console import Console
from rich.markup import escape

from vsnbench.errors import ExitCode, UsageError
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.persons_word import taped
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import StartingPosition
from vsnbench.runner.answers import MisreadError, Said, confirmed, may_begin, measured_m, what_was_touched
from vsnbench.runner.attendant import (
    Display,
    EndedEpisode,
    Judgement,
    Nobody,
    SessionOverError,
    TrialSkippedError,
    Upcoming,
)
from vsnbench.runner.case import SURPRISE_M, Case
from vsnbench.runner.desk import AnsweredMeanwhileError, Asks, Choice, Desk, Question, RepliedElsewhereError, Reply
from vsnbench.runner.emergency_stop import EmergencyStop
from vsnbench.runner.episode import EpisodePlan, Step
from vsnbench.runner.placing import Placing
from vsnbench.runner.session import TAKEN_AGAIN
from vsnbench.runner.stopping import StopAuthor, Stopped, Stopping, StopRequest, leave_dead_terminal
from vsnbench.runner.terminal_placing import PlacingFace

Answer = TypeVar("Answer")

TERMINAL = "the terminal"


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
            advice="run in a terminal, without --quiet, or with --unattended (the episodes then await judgement: "
            "`vsnbench judge --pending`)",
        )


def forget_typed() -> None:
    """Drop what was typed before a question is put: keys pressed while the robot drove are no answer to it."""
    import termios

    with contextlib.suppress(OSError, ValueError, termios.error):
        if sys.stdin.isatty():
            termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)


@dataclass(frozen=True, slots=True)
class Beside:
    """What the person beside the robot has to do with it."""

    name: str = ""
    """Who sits at the terminal."""
    begins: bool = False
    """No trial is begun before somebody has said go, though the robot stands at its start by itself."""
    by_page: bool = False
    """A page serves the desk too: `TAKEN_AGAIN` is run again, and the session ends when somebody says so."""


class Operator(Nobody):
    """A person at the desk: the terminal is one face of it, and it listens for what is said at the others."""

    def __init__(
        self,
        display: TerminalDisplay,
        emergency: EmergencyStop,
        stop: Stopping,
        desk: Desk,
        beside: Beside | None = None,
        read_line: Callable[[], str] | None = None,
    ) -> None:
        super().__init__(display)
        self._console = display.console
        self._paused = display.paused
        self._emergency = emergency
        self._stop = stop
        self._desk = desk
        self._beside = beside or Beside()
        self._read_line = read_line or desk.read_line
        self._said_go = ""

    @property
    def beside(self) -> str:
        """Whoever said go last."""
        return self._said_go

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Show it; wait for the go where a robot that stands by itself needs one."""
        self._desk.board.trial_begins(upcoming)
        super().trial_begins(upcoming)
        if self._beside.begins:
            with self._question(Asks.BEGIN) as question:
                plan = upcoming.plan
                self._console.print(f"Next: [bold]{plan.goal} from starting position {plan.start.number}[/bold]")
                self._go_on(self._first(question, self._typed_go("Enter to go (skip / end): ")))
        self._desk.tell()

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Show it."""
        self._desk.board.step_taken(plan, step)
        super().step_taken(plan, step)
        self._desk.tell()

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Show it."""
        board = self._desk.board
        self._desk.driving = False
        board.episode_ended(ended)
        if self._beside.by_page and ended.outcome.verdict.end_reason in TAKEN_AGAIN and board.upcoming:
            board.again.append(board.upcoming.trial)
        super().episode_ended(ended)
        self._desk.record_changed()

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Name the starting position, have its placing checked, and wait for the go."""
        x, y = start.position
        where = f"x {x:.2f} m, y {y:.2f} m, facing {start.heading_deg:g}°"
        face = PlacingFace(placing, self._console, self._ask, self._desk)
        with self._question(Asks.PLACE, problem) as question:
            if problem:
                self._console.print(f"[yellow]not yet[/yellow]: {escape(problem)}")
            note = f" ({start.note})" if start.note else ""
            self._console.print(
                f"Put the robot at [bold]starting position {start.number}[/bold]: {where}{escape(note)}"
            )
            reply = self._first(question, face.typed, face.wished)
        self._go_on(reply)
        self._console.print("[dim]driving; the space bar stops the robot and ends this episode[/dim]")

    def again(self) -> Sequence[int]:
        """Return what was stopped, failed or was declared void with a page beside."""
        wanted = self._desk.board.again
        return [wanted.popleft() for _ in range(len(wanted))]

    def nothing_left(self) -> Sequence[int]:
        """Ask at a page whether the session is over: an episode may yet be declared void, and run again."""
        if not self._beside.by_page:
            return ()
        self._desk.board.upcoming = None
        with self._question(Asks.FINISH) as question:
            self._console.print("No trial is left. The page still takes corrections.")
            reply = self._first(question, self._typed_go("Enter ends the session: ", Choice.END))
        return self.again() if reply.said is Choice.AGAIN else ()

    def judge(self, ended: EndedEpisode) -> Judgement | None:
        """Ask what the robot touched and how far it is from the goal; None for later."""
        judgement: Judgement | None = None
        try:
            with self._question(Asks.JUDGE) as question:
                case = Case.of_ended(ended)
                reply = self._first(question, lambda: self._asked(case, ended.plan) or Choice.LATER)
                if isinstance(reply.said, Judgement):
                    judgement = replace(reply.said, author=reply.author)
        finally:
            if judgement is None:
                self._console.print(
                    f"\n[yellow]#{ended.number} awaits judgement[/yellow]: vsnbench judge {ended.number}"
                )
        if judgement is not None:
            if judgement.verdict.success is None:
                self._desk.board.declared_void()
            self._display.judged(judgement.verdict.success)
            who = "you" if reply.face == TERMINAL else f"{escape(reply.author)} at {reply.face}"
            self._console.print(f"[dim]#{ended.number} judged by {who}:[/dim] {escape(judgement.verdict.text)}")
        return judgement

    @contextmanager
    def _question(self, asks: Asks, problem: str = "") -> Iterator[Question]:
        with self._desk.ask(asks, problem) as question, self._emergency.off(), self._paused():
            yield question

    def _first(
        self,
        question: Question,
        typed: Callable[[], Choice | Judgement],
        wished: Callable[[str], None] = lambda _wish: None,
    ) -> Reply:
        """Return what is said first, here or elsewhere; what is wished meanwhile is done."""
        while question.reply is None:
            try:
                said = typed()
                return self._desk.reply(question.number, said, self._beside.name, TERMINAL)
            except RepliedElsewhereError:
                self._console.print()
            except AnsweredMeanwhileError as late:
                self._console.print(f"\n[yellow]{escape(str(late))}[/yellow]")
            while question.wishes and question.reply is None:
                wished(question.wishes.pop(0))
        reply = question.reply
        told = reply.said.value if isinstance(reply.said, Choice) else "a judgement"
        self._console.print(f"[cyan]{escape(reply.author or 'somebody')} answered at {reply.face}[/cyan]: {told}")
        return reply

    def _go_on(self, reply: Reply) -> None:
        if reply.said is Choice.SKIP:
            raise TrialSkippedError
        if reply.said is Choice.END:
            raise SessionOverError(f"{reply.author or 'somebody'} ended the session at {reply.face}")
        self._said_go = reply.author

    def _typed_go(self, prompt: str, go: Choice = Choice.GO) -> Callable[[], Choice]:
        said = {Said.GO: go, Said.LATER: Choice.SKIP if go is Choice.GO else go, Said.END: Choice.END}
        return lambda: said[self._until(prompt, may_begin)]

    def _asked(self, case: Case, plan: EpisodePlan) -> Judgement | None:
        proposed = case.proposal
        if proposed is None:
            raise ValueError("an episode that has just ended has a verdict or a proposal")
        if proposed.end_reason is EndReason.COLLISION:
            there_was = self._until("The robot felt a collision. Was there one? (yes / later): ", confirmed)
            return Judgement(proposed) if there_was else None
        touched = self._touched()
        if touched is Said.LATER:
            return None
        if isinstance(touched, str):
            return Judgement(case.collided(touched), note=touched, called_collision=True)
        return self._measured(case, plan) if proposed.end_reason is EndReason.STOP else Judgement(proposed)

    def _touched(self) -> Said | str:
        while True:
            told = self._until("Did it touch anything? (no / what / later): ", what_was_touched)
            if isinstance(told, Said) or self._is_sure(f"A collision with {told!r}: the episode has failed"):
                return told

    def _measured(self, case: Case, plan: EpisodePlan) -> Judgement | None:
        estimate, proposed = case.estimate, case.proposal
        if estimate is None or proposed is None:
            raise ValueError("an episode that ended with STOP has a distance to the goal")
        question = f"Metres by tape to the nearest {plan.goal}? (0.84 / keep {estimate.distance_m:.2f} / later): "
        while True:
            told = self._until(question, partial(measured_m, site=plan.site))
            if isinstance(told, Said):
                return None if told is Said.LATER else Judgement(proposed)
            far_off = abs(told - estimate.distance_m) > SURPRISE_M
            if not far_off or self._is_sure(f"{told:.2f} m, and odometry says {estimate.distance_m:.2f} m"):
                return Judgement(taped(EndReason.STOP, case.actions, told, estimate.instance, plan.parameters))

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
                raise Stopped(
                    StopRequest(StopAuthor.SYSTEM, "a terminal that was closed", exit_code=ExitCode.HUNG_UP)
                ) from None
