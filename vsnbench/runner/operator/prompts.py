"""Questions to the operator: one at a time, as data. The first answer wins, from the terminal or a browser.

The main thread asks and waits. The terminal and any number of browsers show the question and answer from their own
threads. A late answer is refused with the name of who was first.
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
from vsnbench.runner.operator.contract import Judgement
from vsnbench.runner.operator.session_state import SessionState
from vsnbench.runner.stopping.requests import Ends, StopAuthor, StopRequest

UNKNOWN_OPERATOR = "an operator"
"""Shown for an operator without a name."""


class AnsweredMeanwhileError(VsnbenchError):
    """The question has an answer already, or is no longer asked."""

    code = "answered-meanwhile"


class RepliedElsewhereError(Exception):
    """A browser answered, or requested an action, while the terminal waited for a line."""


class QuestionKind(StrEnum):
    """What the operator is asked."""

    BEGIN = "begin"
    """The robot is at its start by itself: may it drive?"""
    PLACE = "place"
    """The operator puts the robot at its start: may it drive?"""
    JUDGE = "judge"
    """How did the episode end?"""
    FINISH = "finish"
    """No trial is left: does the session end?"""


class Choice(StrEnum):
    """Answers other than a judgement."""

    GO = "go"
    SKIP = "skip"
    """Run this trial later."""
    END = "end"
    """End the session."""
    LATER = "later"
    """Leave the episode awaiting judgement."""
    AGAIN = "again"
    """Some trials must run again."""


ANSWERS: dict[QuestionKind, frozenset[Choice]] = {
    QuestionKind.BEGIN: frozenset({Choice.GO, Choice.SKIP, Choice.END}),
    QuestionKind.PLACE: frozenset({Choice.GO, Choice.SKIP, Choice.END}),
    QuestionKind.JUDGE: frozenset({Choice.LATER}),
    QuestionKind.FINISH: frozenset({Choice.END, Choice.AGAIN}),
}
"""Valid choices of each question. JUDGE takes a judgement as well."""


@dataclass(slots=True)
class Question:
    """A question to the operator, open until it has an answer; the first one counts."""

    number: int
    kind: QuestionKind
    problem: str = ""
    """What was wrong with the last attempt, for the display."""
    answer: Choice | Judgement | None = None
    author: str = ""
    """Name of the person who answered; empty if it is not known."""
    source: str = ""
    """Where the answer was given: `the terminal` or `the page`."""
    answered_at: datetime | None = None
    actions: list[str] = field(default_factory=list)
    """Actions that browsers request while the question is open, for example to look around."""


class OperatorPrompts:
    """The questions of one session and their answers; safe to use from any thread."""

    def __init__(
        self,
        terminal: int | None = None,
        halt: Callable[[], None] = lambda: None,
        request_stop: Callable[[StopRequest], None] = lambda _request: None,
    ) -> None:
        """Start without a question.

        Args:
            terminal: file descriptor of the terminal for typed answers; None if there is none.
            halt: halts the robot, from any thread; returns when it is at rest.
            request_stop: requests a stop, from any thread.
        """
        self._lock = threading.RLock()
        self._terminal = terminal
        self._wakes, self._wake = os.pipe()
        os.set_blocking(self._wakes, False)
        os.set_blocking(self._wake, False)
        self._question: Question | None = None
        self._answered: dict[int, Question] = {}
        # Not from 1: a browser that outlives a killed run must not answer a question that it does not show.
        self._last = secrets.randbelow(2**30)
        self._paused_by = ""
        self._asks_where = threading.Event()
        self._arrived = threading.Event()
        self.halt = halt
        self._request_stop = request_stop
        self.state = SessionState()
        self.driving = False
        """The robot may drive: from the operator's go to the end of the episode."""
        self.show_message: Callable[[str], None] = lambda _text: None
        """Prints a line at the terminal, from any thread."""
        self.ended_by = ""
        """Name of the operator who ended the session; empty while it runs."""
        self.changes = 0
        """Number of episodes that ended or were judged."""
        self.listeners: list[Callable[[], None]] = []
        """Called when something has changed, from any thread."""

    @property
    def question(self) -> Question | None:
        """The open question."""
        return self._question

    @property
    def may_drive(self) -> bool:
        """Whether the robot drives, or a trial is left in which it will; a STOP is needed only then."""
        question = self._question
        return not self.ended_by and (question is None or question.kind is not QuestionKind.FINISH)

    @property
    def paused_by(self) -> str:
        """Name of the operator who paused the session; empty while it runs."""
        return self._paused_by

    def pause(self, author: str) -> None:
        """Accept no go until the session is resumed; an empty name resumes it."""
        self._paused_by = author
        self.notify()

    def ask_where(self) -> None:
        """Have the robot's pose measured once its action has ended. Does nothing unless the robot drives."""
        if self.driving:
            self._asks_where.set()
            self.state.whereabouts = "measuring after this action …"
            self.notify()

    def take_where(self) -> bool:
        """Return whether the pose was asked for since the last call."""
        asked = self._asks_where.is_set()
        self._asks_where.clear()
        return asked

    def declare_arrival(self) -> None:
        """Say that the robot has arrived. Does nothing unless the operator is asked for that."""
        if self.driving and self.state.can_declare:
            self._arrived.set()

    def take_arrival(self) -> bool:
        """Return whether an operator has declared an arrival since the last call."""
        arrived = self._arrived.is_set()
        self._arrived.clear()
        return arrived

    def end_episode(self, author: str, means: str) -> bool:
        """Request the end of the running episode, without waiting. Call `halt` afterwards.

        The request comes first because a movement that the halt interrupts would count as a failure of the base.

        Returns:
            Whether an episode was running.
        """
        driving = self.driving
        if driving:
            self._request_stop(StopRequest(StopAuthor.PERSON, means, Ends.EPISODE, who=author))
        return driving

    @contextmanager
    def ask(self, kind: QuestionKind, problem: str = "") -> Iterator[Question]:
        """Open a question; the block's end closes it."""
        with self._lock:
            self._last += 1
            question = Question(self._last, kind, problem)
            self._question = question
            with contextlib.suppress(BlockingIOError):
                while os.read(self._wakes, 4096):
                    pass
        self.notify()
        try:
            yield question
        finally:
            with self._lock:
                self._question = None
            self.notify()

    def reply(self, number: int, answer: Choice | Judgement, author: str, source: str) -> Question:
        """Answer a question.

        Raises:
            AnsweredMeanwhileError: the question has an answer, is no longer asked, or the session is paused.
            ValueError: the answer does not fit the question.
        """
        with self._lock:
            question = self._open(number)
            is_judgement = question.kind is QuestionKind.JUDGE and isinstance(answer, Judgement)
            if answer not in ANSWERS[question.kind] and not is_judgement:
                raise ValueError(f"{answer} is not an answer to {question.kind}")
            if answer is Choice.GO and self._paused_by:
                raise AnsweredMeanwhileError(
                    f"{self._paused_by} has paused the session", advice="resume it first", code="session-paused"
                )
            question.author, question.source, question.answered_at = author, source, datetime.now(UTC)
            question.answer = answer  # last, because other threads take it for the sign of an answer
            self._answered[number] = question
            if answer is Choice.GO:
                self.driving = True
                self.state.driving_begins()
            if answer is Choice.END:
                self.ended_by = author or UNKNOWN_OPERATOR
            os.write(self._wake, b".")
        self.notify()
        return question

    def request_action(self, number: int, action: str) -> None:
        """Request an action of the main thread while a question is open.

        Raises:
            AnsweredMeanwhileError: the question is no longer open.
        """
        with self._lock:
            self._open(number).actions.append(action)
            os.write(self._wake, b".")

    def read_line(self) -> str:
        """Wait in the main thread for a typed line. A signal's exception passes through.

        Raises:
            RepliedElsewhereError: a browser answered or requested an action.
            EOFError: the terminal is closed.
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
        """Notify displays that an episode ended or was judged."""
        self.changes += 1
        self.notify()

    def notify(self) -> None:
        """Notify displays of a change."""
        for listener in list(self.listeners):
            listener()

    def _open(self, number: int) -> Question:
        question = self._question
        if question is None or question.number != number or question.answer is not None:
            raise AnsweredMeanwhileError(self._first_answer(number))
        return question

    def _first_answer(self, number: int) -> str:
        if (first := self._answered.get(number)) is None or first.answered_at is None:
            return "this question is no longer asked; answer the current one"
        what = "judged it" if isinstance(first.answer, Judgement) else f"answered {first.answer}"
        at = f"{first.answered_at.astimezone():%H:%M:%S}"
        return f"{first.author or UNKNOWN_OPERATOR} {what} first, at {first.source}, {at}"
