"""A connection to a motion adapter: requests and answers as of a model, and movements that report their progress."""

import contextlib
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from vsnbench import __version__
from vsnbench.errors import NoAnswerError, RobotError
from vsnbench.models.remote.connection import Connection
from vsnbench.models.remote.peer import Address, Peer
from vsnbench.models.remote.vsnbench_policy import MAX_MESSAGE_BYTES, pack
from vsnbench.robots.adapter.messages import AdapterCard, InvalidAnswerError
from vsnbench.text.sanitize import sanitize
from vsnbench.values.encoding.motion_answer import MOST_TEXT

OLDEST_VERSION, NEWEST_VERSION = 1, 1
"""Versions of the protocol in docs/motion-adapter.md."""
GONE_S = 0.6
"""An adapter stops the robot if the client has not answered its progress for this long."""
PROGRESS_S = 0.5
"""Longest time between two messages of an adapter while a movement runs."""
ANSWER_S = 2.0
"""Time for an answer: to a request, to `stop`, and after the deadline of a movement."""
SIMULATOR_FACTOR = 10.0
"""A simulator has so much longer: it may compute more slowly than time passes, and nothing moves meanwhile."""


IN_USE: Final = "robot-in-use"
"""Code of the error if another client uses the robot."""

ADAPTER = Peer(
    noun="adapter",
    failed=InvalidAnswerError,
    lost=NoAnswerError,
    busy=partial(RobotError, code=IN_USE),
    versions=(OLDEST_VERSION, NEWEST_VERSION),
    max_bytes=MAX_MESSAGE_BYTES,
    start="start it, and check interface.address in the profile",
    replace="write it for this version: docs/motion-adapter.md",
)

TakeProgress = Callable[[Mapping[str, Any]], str]
"""Takes a `progress` message; returns why the robot must stop, or an empty string."""


class AdapterConnection(Connection):
    """An open connection to an adapter, for one thread; only `stop` may be called by others."""

    def __init__(self, address: str, token: str) -> None:
        """Connect and read the card.

        Raises:
            NoAnswerError: no adapter answers.
            RobotError: the server is not an adapter, speaks another version, refuses, or is in use.
        """
        super().__init__(Address.parse(address, token, "adapter"), token, f"vsnbench {__version__}", ADAPTER)
        try:
            self.card = AdapterCard.of(self.greeting.get("card"))
        except InvalidAnswerError as error:
            self.close()
            raise InvalidAnswerError(f"the adapter at {address}: {error.statement}", code="invalid-card") from error
        self._slack = slack = SIMULATOR_FACTOR if self.card.simulation else 1.0
        self._answer_s, self._silence_s = slack * ANSWER_S, slack * (PROGRESS_S + GONE_S)

    def request(self, kind: str, timeout_s: float = 0.0, **content: Any) -> Mapping[str, Any]:
        """Send a request and return its answer, which may take `timeout_s` or the time of every answer.

        Raises:
            NoAnswerError: no answer in time, or the connection broke.
            RobotError: the adapter reports an error, or answers something else.
        """
        message = self.ask({"type": kind, **content}, max(self._slack * timeout_s, self._answer_s)).message
        if (found := message.get("type")) != _ANSWER_TO[kind]:
            if found == "error":
                raise RobotError(self._reported(message), code="adapter-error")
            self.close()
            raise InvalidAnswerError(f"the adapter answered {kind} with {found!r:.40} instead of {_ANSWER_TO[kind]}")
        return message

    def stop(self) -> None:
        """Tell the adapter to stop the robot; safe from any thread, also during a movement.

        Raises:
            NoAnswerError: the connection is broken.
        """
        try:
            with self._deadline(ANSWER_S, "stop"):
                self._socket.send(pack({"type": "stop"}))
        except TimeoutError as error:
            raise NoAnswerError(
                f"the adapter at {self.address} does not read", advice="stop the robot by hand"
            ) from error

    def drive(
        self, movement: Mapping[str, Any], deadline_s: float, take: TakeProgress, *, watch: bool
    ) -> tuple[Mapping[str, Any], str]:
        """Have one movement executed; return the `done` message, and why this client stopped it.

        Args:
            movement: JSON of the movement.
            deadline_s: time in which the adapter has to end it.
            take: takes every progress. If it raises, the robot is stopped first.
            watch: whether the progress needs depth images.

        Raises:
            NoAnswerError: the adapter does not answer, not even to `stop`; or the connection broke.
            RobotError: the adapter reports an error, or breaks the protocol.
        """
        self._number += 1
        request = {"type": "drive", "seq": self._number, "movement": movement, "deadline_s": deadline_s, "watch": watch}
        try:
            with self._deadline(self._slack * deadline_s + 3 * self._answer_s, "drive"):
                self._socket.send(pack(request))
                return self._follow(time.monotonic() + self._slack * deadline_s + self._answer_s, take)
        except TimeoutError as error:
            self.close()
            raise NoAnswerError(
                f"the adapter at {self.address} does not answer `stop`", advice="stop the robot by hand"
            ) from error
        except RobotError:
            self.close()
            raise
        except BaseException:  # a request to stop; the answer to this movement is dropped when it arrives
            with contextlib.suppress(RobotError):
                self.stop()
            raise

    def _follow(self, give_up_s: float, take: TakeProgress) -> tuple[Mapping[str, Any], str]:
        """Answer the progress of the running movement until it is done.

        Silence counts only once nothing is left to read: this process may have been paused itself.
        """
        reason, raised, stopped_s, heard_s = "", None, 0.0, time.monotonic()
        while True:
            until_s = stopped_s + self._answer_s if stopped_s else min(heard_s + self._silence_s, give_up_s)
            try:
                message = self._received(self._socket.recv(timeout=max(0.0, until_s - time.monotonic())))
            except TimeoutError:
                if stopped_s:
                    raise
                reason = self._late_text(give_up_s, heard_s)
                stopped_s = self._stop_now()
                continue
            if self._answered(message) != self._number:
                continue
            heard_s, kind = time.monotonic(), message.get("type")
            if kind == "done":
                if raised is not None:
                    raise raised
                return message, reason
            if kind == "error":
                raise RobotError(self._reported(message), code="adapter-error")
            if kind != "progress":
                raise InvalidAnswerError(f"the adapter answered drive with {kind!r:.40} instead of progress or done")
            if stopped_s:
                if heard_s > stopped_s + self._answer_s:
                    raise TimeoutError
                continue
            try:
                reason = take(message) or (self._late_text(give_up_s, heard_s) if heard_s > give_up_s else "")
            except BaseException as error:
                raised = error  # a request to stop, or a fault of the message: the robot is stopped first
            if reason or raised is not None:
                stopped_s = self._stop_now()
            else:
                self._socket.send(pack({"type": "go", "seq": self._number}))

    def _stop_now(self) -> float:
        """Tell the adapter to stop; return the time."""
        self.stop()
        return time.monotonic()

    def _late_text(self, give_up_s: float, heard_s: float) -> str:
        now_s = time.monotonic()
        if now_s >= give_up_s:
            return f"the adapter has not ended the movement {self._answer_s:g} s after its deadline"
        return f"the adapter has reported no progress for {now_s - heard_s:.1f} s"

    def _reported(self, message: Mapping[str, Any]) -> str:
        return f"the adapter reports: {sanitize(str(message.get('message'))[:MOST_TEXT])}"


_ANSWER_TO = {"state": "state", "place": "placed", "begin": "ready", "observe": "observation"}
