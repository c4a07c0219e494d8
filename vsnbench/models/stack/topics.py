"""The topic on which a stack says that it has arrived."""

import threading
from typing import Any

from vsnbench.errors import ModelError
from vsnbench.models.stack.file import FromTopic
from vsnbench.sensing.exchange import Exchange, value_at
from vsnbench.text.sanitize import sanitize

_REPEAT_S = 1.0
"""A state is published at least this often; an event is published once."""


class ArrivalTopic:
    """Listens on one topic during all trials.

    A stack publishes its state again and again, or an arrival once. The state of the trial before may still say
    "arrived" when the next goal is announced: it counts once it has said something else.
    """

    def __init__(self, exchange: Exchange, way: FromTopic) -> None:
        self._exchange = exchange
        self._way = way
        self._changed = threading.Condition()
        self._listens = False
        self._count = 0
        """Number of messages."""
        self._value: Any = None
        """Of the last message; None before the first."""
        self._error: ModelError | None = None
        self._is_old = False
        """Whether the value is still that of the trial before."""
        self._arrived = self._failed = False

    def begin(self, timeout_s: float) -> None:
        """Expect the arrival of another trial, whose goal is announced next.

        Raises:
            ModelLostError: no node publishes the topic within `timeout_s`.
            ModelError: the topic has another type.
        """
        self._exchange.await_publisher(self._way.name, self._way.type, timeout_s)
        if not self._listens:
            self._listens = True
            self._exchange.listen(self._way.name, self._way.type, self._take)
        with self._changed:
            before = self._count
            repeats = self._changed.wait_for(lambda: self._count > before, _REPEAT_S if self._says_end else 0.0)
            self._is_old = repeats and self._says_end
            self._arrived = self._failed = False

    @property
    def has_arrived(self) -> bool:
        """Whether the stack has said that it arrived, since `begin`.

        Raises:
            ModelError: it said that it failed, or its messages have no such field.
        """
        with self._changed:
            if self._error is not None:
                raise self._error
            if self._failed and not self._arrived:
                raise ModelError(f"the stack says that it failed: {self._way.name} {sanitize(str(self._way.failed))}")
            return self._arrived

    @property
    def _says_end(self) -> bool:
        return self._value is not None and self._value in (self._way.equals, self._way.failed)

    def _take(self, message: Any) -> None:
        """Take a message, in a thread of the network."""
        with self._changed:
            try:
                value = value_at(message, self._way.field)
            except ModelError as error:
                self._error = error
                return
            self._is_old = self._is_old and value == self._value
            self._count, self._value = self._count + 1, value
            if not self._is_old:
                self._arrived = self._arrived or value == self._way.equals
                self._failed = self._failed or (self._way.failed is not None and value == self._way.failed)
            self._changed.notify_all()
