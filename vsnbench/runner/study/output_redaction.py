"""Hides model output in a blind study: prints, log messages, direct writes, and words that name a model.

A warning or a traceback can identify a model without naming it, and so can its timing. All output is therefore
discarded while a model is loaded or called. Other output of the process loses the words that name models.
"""

import contextlib
import io
import logging
import os
import re
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, Self, TextIO

from vsnbench.models.contract import Policy
from vsnbench.models.task import Task
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.site import Site
from vsnbench.text.streams import SanitizedStream
from vsnbench.values.decision import Decision
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base

REPLACEMENT = "[hidden]"
"""Replaces a revealing word. A code would reveal which model is meant."""
ABOUT_MODELS = ("vsnbench.models", "vsnbench.runner.episode.policy_calls", "vsnbench.runner.setup.trial_setup")
"""Loggers of messages about the current model, including tracebacks."""
_SHORTEST = 2


class OutputRedaction:
    """Replaces the output streams and log handlers of the process while it is entered."""

    def __init__(self, words: Iterable[str]) -> None:
        """Hide these words where they are not part of longer ones."""
        hidden = sorted({word for word in words if len(word) >= _SHORTEST}, key=len, reverse=True)
        any_of = "|".join(map(re.escape, hidden)) or "(?!)"
        self._words = re.compile(rf"(?<![A-Za-z0-9])(?:{any_of})(?![A-Za-z0-9])", re.IGNORECASE)
        self._here = threading.local()
        self._entered = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            streams = {id(stream): self._replaced(stream, stack) for stream in (sys.stdout, sys.stderr)}
            for handler in list(logging.getLogger().handlers):
                handler.addFilter(self._may_pass)
                stack.callback(handler.removeFilter, self._may_pass)
                if isinstance(handler, logging.StreamHandler) and id(handler.stream) in streams:
                    stack.callback(handler.setStream, handler.setStream(streams[id(handler.stream)]))
            stack.callback(setattr, sys, "stdout", sys.stdout)
            stack.callback(setattr, sys, "stderr", sys.stderr)
            sys.stdout, sys.stderr = streams[id(sys.stdout)], streams[id(sys.stderr)]
            self._entered = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._entered.close()

    @contextmanager
    def call(self) -> Iterator[None]:
        """Discard prints and log messages of this thread, and direct writes of any code."""
        self._here.calls = True
        try:
            with _descriptors_discarded():
                yield
        finally:
            self._here.calls = False

    def policy(self, policy: Policy) -> Policy:
        """Return the policy with its output discarded."""
        return RedactedPolicy(policy, self)

    def redacted(self, text: str) -> str:
        """Return what this thread may print of a text."""
        return "" if getattr(self._here, "calls", False) else self._words.sub(REPLACEMENT, text)

    def _may_pass(self, record: logging.LogRecord) -> bool:
        if getattr(self._here, "calls", False) or record.name.startswith(ABOUT_MODELS):
            return False
        record.msg, record.args = self._words.sub(REPLACEMENT, record.getMessage()), ()
        return True

    def _replaced(self, stream: TextIO, stack: ExitStack) -> Any:
        """Return a redacting stream with the same target, with its own descriptor if the stream has one."""
        stream.flush()
        with contextlib.suppress(OSError, ValueError, io.UnsupportedOperation):
            own = os.fdopen(os.dup(stream.fileno()), "w", 1, encoding=stream.encoding, errors=stream.errors)
            replaced = _Stream(SanitizedStream(own) if isinstance(stream, SanitizedStream) else own, self)
            stack.callback(replaced.redirect, stream)
            stack.enter_context(own)
            return replaced
        return _Stream(stream, self)


class _Stream:
    """A text stream that redacts what it writes; delegates everything else."""

    def __init__(self, stream: TextIO | SanitizedStream, redaction: OutputRedaction) -> None:
        self._stream = stream
        self._redaction = redaction

    @property
    def unsanitized(self) -> "_Stream":
        """The stream without sanitizing, for `terminal.Console`, which sanitizes itself."""
        return _Stream(getattr(self._stream, "unsanitized", self._stream), self._redaction)

    def redirect(self, stream: TextIO) -> None:
        """Write to another stream, for code that keeps this one as `sys.stdout` beyond the context."""
        self._stream = stream

    def write(self, text: str) -> int:
        self._stream.write(self._redaction.redacted(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


class RedactedPolicy(Policy):
    """A policy whose output is discarded."""

    def __init__(self, policy: Policy, redaction: OutputRedaction) -> None:
        self._policy = policy
        self._redaction = redaction
        self.card = policy.card
        self.needs_survey, self.asks_operator = policy.needs_survey, policy.asks_operator

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode."""
        with self._redaction.call():
            self._policy.reset(goal, seed)
            self.card = self._policy.card

    def begin(self, task: Task) -> None:
        """Start an episode."""
        with self._redaction.call():
            self._policy.begin(task)
            self.card, self.announcement = self._policy.card, self._policy.announcement

    def next_goal(self, goal: str) -> None:
        """Give the next goal of a sequence."""
        with self._redaction.call():
            self._policy.next_goal(goal)

    def act(self, observation: Observation) -> Decision:
        """Return the next action."""
        with self._redaction.call():
            return self._policy.act(observation)

    def end_episode(self) -> None:
        """Say that the episode has ended."""
        with self._redaction.call():
            self._policy.end_episode()

    def close(self) -> None:
        """Close the policy."""
        with self._redaction.call():
            self._policy.close()

    def survey(self, site: Site, start: Pose, base: Base, parameters: ProtocolParameters) -> None:
        """Pass the site on."""
        with self._redaction.call():
            self._policy.survey(site, start, base, parameters)


@contextmanager
def _descriptors_discarded() -> Iterator[None]:
    """Redirect descriptors 1 and 2 to /dev/null, for C libraries that write to them directly."""
    saved: list[tuple[int, int]] = []
    try:
        with open(os.devnull, "w") as null:  # noqa: PTH123 - a device
            for number in (1, 2):
                with contextlib.suppress(OSError):  # closed by the parent process
                    saved.append((number, os.dup(number)))
                    os.dup2(null.fileno(), number)
        yield
    finally:
        for number, own in saved:
            os.dup2(own, number)
            os.close(own)
