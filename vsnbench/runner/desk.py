"""The desk where a person is asked: one question at a time, as data; whoever answers first, at whatever face, is heard.

The run asks and waits in its main thread; a terminal and any number of pages are faces of the same desk, in threads of
their own. The first reply to a question counts, and whoever comes later is told who was first.
"""

import contextlib
import os
import secrets
import select
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum

from vsnbench.errors import VsnbenchError
from vsnbench.runner.attendant import Judgement
from vsnbench.runner.board import Board
from vsnbench.runner.stopping import Ends, StopAuthor, StopRequest


class AnsweredMeanwhileError(VsnbenchError):
    """Somebody else answered first, or the question is no more."""


class RepliedElsewhereError(Exception):
    """The question that is read for at the terminal has been answered at another face."""


class Asks(StrEnum):
    """What a person is asked for."""

    BEGIN = "begin"
    """The robot stands at its start by itself: may it drive?"""
    PLACE = "place"
    """Put the robot at its start: may it drive?"""
    JUDGE = "judge"
    """What became of the episode?"""
    FINISH = "finish"
    """No trial is left: is the session over?"""


class Choice(StrEnum):
    """What can be said but a judgement."""

    GO = "go"
    SKIP = "skip"
    """This trial later."""
    END = "end"
    """The session is over."""
    LATER = "later"
    """The episode awaits its judgement."""
    AGAIN = "again"
    """There is something to be run again."""


ANSWERS: dict[Asks, frozenset[Choice]] = {
    Asks.BEGIN: frozenset({Choice.GO, Choice.SKIP, Choice.END}),
    Asks.PLACE: frozenset({Choice.GO, Choice.SKIP, Choice.END}),
    Asks.JUDGE: frozenset({Choice.LATER}),
    Asks.FINISH: frozenset({Choice.END, Choice.AGAIN}),
}
"""What may be said to each, beside a judgement where one is asked for."""


@dataclass(frozen=True, slots=True)
class Reply:
    """What was said first."""

    said: Choice | Judgement
    author: str
    face: str
    """Where: `the terminal`, `the page`."""
    at: datetime


@dataclass(slots=True)
class Question:
    """Something a person is asked; it stands until somebody has replied."""

    number: int
    asks: Asks
    asked_at: datetime
    problem: str = ""
    """What was wrong with the last attempt, for people."""
    reply: Reply | None = None
    wishes: list[str] = field(default_factory=list)
    """What was asked of the run while the question stands: to look where the robot is, for instance."""


class Desk:
    """Where the run asks; safe to use from any thread."""

    def __init__(self, terminal: int | None = None) -> None:
        """Make a desk without a question.

        Args:
            terminal: descriptor of the terminal where answers may be typed; None where there is none.
        """
        self._lock = threading.RLock()
        self._terminal = terminal
        self._wakes, self._wake = os.pipe()
        os.set_blocking(self._wakes, False)
        os.set_blocking(self._wake, False)
        self._question: Question | None = None
        self._answered: dict[int, Reply] = {}
        self._last = secrets.randbelow(2**30)
        # Not from 1: a phone that outlives a killed run must not answer another question than it shows.
        self._paused_by = ""
        self._halt: Callable[[], None] = lambda: None
        self._ask_to_stop: Callable[[StopRequest], None] = lambda _request: None
        self.board = Board()
        self.driving = False
        """Between the go and the end of an episode."""
        self.says: Callable[[str], None] = lambda _words: None
        """Writes a line at the terminal, from any thread."""
        self.ended_by = ""
        """Who has ended the session; empty while it goes on."""
        self.changes = 0
        """How often something ended or was judged."""
        self.told: list[Callable[[], None]] = []
        """Called, in any thread, when something has changed."""

    @property
    def question(self) -> Question | None:
        """What is asked now."""
        return self._question

    @property
    def paused_by(self) -> str:
        """Who has the session rest; empty where nobody has."""
        return self._paused_by

    def pause(self, author: str) -> None:
        """Have the session rest: no go is taken until it goes on; empty lets it go on."""
        self._paused_by = author
        self.tell()

    def attends(self, halt: Callable[[], None], ask_to_stop: Callable[[StopRequest], None]) -> None:
        """Say how the robot is stood still and how a stop is asked for, both from any thread."""
        self._halt, self._ask_to_stop = halt, ask_to_stop

    def end_episode(self, author: str, means: str) -> bool:
        """Ask for the end of the episode that is driven, where one is; never waits. `halt` comes after it.

        The request comes first, or the movement that the halt cuts short would be taken for the base's failure.

        Args:
            author: who says so.
            means: by what, for the record.

        Returns:
            Whether an episode is ended by it.
        """
        driving = self.driving
        if driving:
            self._ask_to_stop(StopRequest(StopAuthor.PERSON, means, Ends.EPISODE, who=author))
        return driving

    def halt(self) -> None:
        """Stand the robot still at once; takes as long as the robot's halt does."""
        self._halt()

    @contextmanager
    def ask(self, asks: Asks, problem: str = "") -> Iterator[Question]:
        """Put a question; it is gone with the block."""
        with self._lock:
            self._last += 1
            question = Question(self._last, asks, datetime.now(UTC), problem)
            self._question = question
            with contextlib.suppress(BlockingIOError):
                while os.read(self._wakes, 4096):
                    pass
        self.tell()
        try:
            yield question
        finally:
            with self._lock:
                self._question = None
            self.tell()

    def reply(self, number: int, said: Choice | Judgement, author: str, face: str) -> Reply:
        """Answer a question.

        Raises:
            AnsweredMeanwhileError: somebody was first, it is no longer asked, or the session rests.
            ValueError: that is no answer to it.
        """
        with self._lock:
            question = self._question
            if question is None or question.number != number or question.reply is not None:
                raise AnsweredMeanwhileError(self._who_was_first(number))
            if said not in ANSWERS[question.asks] and not (question.asks is Asks.JUDGE and isinstance(said, Judgement)):
                raise ValueError(f"{said} is no answer to {question.asks}")
            if said is Choice.GO and self._paused_by:
                raise AnsweredMeanwhileError(f"{self._paused_by} has paused the session", advice="resume it first")
            question.reply = self._answered[number] = Reply(said, author, face, datetime.now(UTC))
            if said is Choice.GO:
                self.driving = True
                self.board.goes()
            if said is Choice.END:
                self.ended_by = author or "somebody"
            os.write(self._wake, b".")
        self.tell()
        return question.reply

    def wish(self, number: int, what: str) -> None:
        """Ask something of the run while its question stands.

        Raises:
            AnsweredMeanwhileError: it does not stand any more.
        """
        with self._lock:
            question = self._question
            if question is None or question.number != number or question.reply is not None:
                raise AnsweredMeanwhileError(self._who_was_first(number))
            question.wishes.append(what)
            os.write(self._wake, b".")

    def read_line(self) -> str:
        """Wait, in the main thread, for a typed line; a signal's exception passes through.

        Raises:
            RepliedElsewhereError: another face has answered, or wishes something.
            EOFError: nobody is at the terminal any more.
        """
        watched = [self._wakes] if self._terminal is None else [self._wakes, self._terminal]
        ready = select.select(watched, [], [])[0]
        if self._wakes in ready:
            os.read(self._wakes, 4096)
            raise RepliedElsewhereError
        try:
            line = sys.stdin.readline()
        except OSError as error:
            raise EOFError from error
        if not line:
            raise EOFError
        return line

    def record_changed(self) -> None:
        """Tell every face that something ended, or was judged."""
        self.changes += 1
        self.tell()

    def tell(self) -> None:
        """Tell every face that something has changed."""
        for face in list(self.told):
            face()

    def _who_was_first(self, number: int) -> str:
        if (reply := self._answered.get(number)) is None:
            return "this is not asked any more: look at what is asked now"
        what = "judged it" if isinstance(reply.said, Judgement) else f"said {reply.said}"
        return f"{reply.author or 'somebody'} {what} first, at {reply.face}, {reply.at.astimezone():%H:%M:%S}"
