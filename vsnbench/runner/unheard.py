"""Keeps models unheard while a study is blind: what they print, log or write past Python, and the words that name them.

A warning of missing weights or a traceback gives a model away without naming it, and so would the moment at which it
comes. So nothing is heard of a model while it is loaded or called, whatever it says it with; of what this process says
at other times, certain words are left out.
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
from types import TracebackType
from typing import Any, Self, TextIO

from vsnbench.models.contract import ModelCard, Policy, SurveyedPolicy
from vsnbench.protocol.decision import Decision
from vsnbench.protocol.observation import Observation
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import Base
from vsnbench.protocol.site import Site

UNSAID = "[hidden]"
"""What stands in a line in place of a word that gives a model away; not a code, which would give it away too."""
ABOUT_MODELS = ("vsnbench.models", "vsnbench.runner.policy_calls", "vsnbench.runner.bench")
"""Loggers that speak of the model that is used at that moment, tracebacks among it."""
_SHORTEST = 2


class ModelsUnheard:
    """Replaces what this process prints and logs with, while it is entered."""

    def __init__(self, words: Iterable[str]) -> None:
        """Leave out these words, wherever they stand by themselves."""
        known = sorted({word for word in words if len(word) >= _SHORTEST}, key=len, reverse=True)
        any_of = "|".join(map(re.escape, known)) or "(?!)"
        self._words = re.compile(rf"(?<![A-Za-z0-9])(?:{any_of})(?![A-Za-z0-9])", re.IGNORECASE)
        self._here = threading.local()
        self._until_left = ExitStack()

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
            self._until_left = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._until_left.close()

    @contextmanager
    def call(self) -> Iterator[None]:
        """Hear nothing of what is called: this thread's prints and log lines, and what any code writes by itself."""
        self._here.calls = True
        try:
            with _descriptors_to_nowhere():
                yield
        finally:
            self._here.calls = False

    def policy(self, policy: Policy) -> Policy:
        """Return the policy, heard no more."""
        return UnheardSurveyed(policy, self) if isinstance(policy, SurveyedPolicy) else UnheardPolicy(policy, self)

    def said(self, text: str) -> str:
        """Return what may be said of a text by this thread now."""
        return "" if getattr(self._here, "calls", False) else self._words.sub(UNSAID, text)

    def _may_pass(self, record: logging.LogRecord) -> bool:
        if getattr(self._here, "calls", False) or record.name.startswith(ABOUT_MODELS):
            return False
        record.msg, record.args = self._words.sub(UNSAID, record.getMessage()), ()
        return True

    def _replaced(self, stream: TextIO, stack: ExitStack) -> Any:
        """Return a stream to the same place, by a descriptor of its own where the stream has one."""
        stream.flush()
        with contextlib.suppress(OSError, ValueError, io.UnsupportedOperation):
            own = os.fdopen(os.dup(stream.fileno()), "w", 1, encoding=stream.encoding, errors=stream.errors)
            replaced = _Stream(own, self)
            stack.callback(replaced.lead_to, stream)
            stack.enter_context(own)
            return replaced
        return _Stream(stream, self)


class _Stream:
    """A text stream that writes what may be said; everything else is the stream's own."""

    def __init__(self, stream: TextIO, unheard: ModelsUnheard) -> None:
        self._stream = stream
        self._unheard = unheard

    def lead_to(self, stream: TextIO) -> None:
        """Go on in another stream: whoever took this one for `sys.stdout`, colours at exit say, writes to it later."""
        self._stream = stream

    def write(self, text: str) -> int:
        self._stream.write(self._unheard.said(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


class UnheardPolicy:
    """A policy of which nothing is heard."""

    def __init__(self, policy: Policy, unheard: ModelsUnheard) -> None:
        self._policy = policy
        self._unheard = unheard
        self.card: ModelCard = policy.card

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode."""
        with self._unheard.call():
            self._policy.reset(goal, seed)
            self.card = self._policy.card

    def act(self, observation: Observation) -> Decision:
        """Return the next action."""
        with self._unheard.call():
            return self._policy.act(observation)

    def close(self) -> None:
        """Let the policy go."""
        with self._unheard.call():
            getattr(self._policy, "close", lambda: None)()


class UnheardSurveyed(UnheardPolicy):
    """The same for a policy that is handed the site."""

    _policy: SurveyedPolicy

    def survey(self, site: Site, start: Pose, base: Base, parameters: ProtocolParameters) -> None:
        """Hand the site on."""
        with self._unheard.call():
            self._policy.survey(site, start, base, parameters)


@contextmanager
def _descriptors_to_nowhere() -> Iterator[None]:
    """Let descriptors 1 and 2 lead nowhere: a library in C writes there without asking Python."""
    kept: list[tuple[int, int]] = []
    try:
        with open(os.devnull, "w") as nowhere:  # noqa: PTH123 - a device
            for number in (1, 2):
                with contextlib.suppress(OSError):  # closed by whoever started us
                    kept.append((number, os.dup(number)))
                    os.dup2(nowhere.fileno(), number)
        yield
    finally:
        for number, own in kept:
            os.dup2(own, number)
            os.close(own)
