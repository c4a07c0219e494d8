"""One trial of a stack: a thread announces the goal, and asks whether the stack has arrived."""

import os
import shutil
import signal
import subprocess
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vsnbench.errors import ModelError, ModelLostError, VsnbenchError
from vsnbench.models.stack.file import GOAL_WORD, Stack, ToAction, ToTopic
from vsnbench.models.stack.http import get, post
from vsnbench.models.stack.topics import ArrivalTopic
from vsnbench.runtime.child_process import command_that_ends_with_parent
from vsnbench.sensing.exchange import ActionGoal, Exchange
from vsnbench.text.sanitize import error_line, sanitize

_POLL_S = 0.2
_GRACE_S = 2.0
"""Time after SIGINT in which a command ends by itself."""


class StackTrial:
    """Announces one goal, follows what the stack declares, and aborts; no call of it waits except `finish`."""

    def __init__(
        self,
        stack: Stack,
        goal: Mapping[str, Any],
        directory: Path,
        exchange: Exchange | None = None,
        heard: ArrivalTopic | None = None,
    ) -> None:
        """Announce a goal.

        Args:
            stack: the stack.
            goal: what is sent to it: `goal`, and `id`, `kind`, `category` and `text` of it.
            directory: in which its commands run.
            exchange: the network of its robot, for topics and actions.
            heard: the topic on which it says that it has arrived.
        """
        self._stack = stack
        self._goal = goal
        self._directory = directory
        self._exchange = exchange
        self._heard = heard
        self._action: ActionGoal | None = None
        self._over = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None
        self._error: VsnbenchError | None = None
        self._abort_error = ""
        self._announced = self._arrived = False
        self._thread = threading.Thread(target=self._run, name="stack", daemon=True)
        self._thread.start()

    @property
    def has_arrived(self) -> bool:
        """Whether the stack has declared that it arrived.

        Raises:
            ModelError: it failed, or its answer cannot be used.
            ModelLostError: it does not answer.
        """
        if self._error is not None and not self._arrived:
            raise self._error
        return self._arrived

    def end(self) -> None:
        """Let the thread tell the stack that the trial is over."""
        self._over.set()

    def finish(self) -> str:
        """Wait until the stack has been told that the trial is over; return why that failed, or an empty string."""
        self._over.set()
        self._thread.join(self._stack.timeout_s + _GRACE_S + 1.0)
        if self._thread.is_alive():
            return "it could not be told in time"
        return self._abort_error if self._announced else ""

    def _run(self) -> None:
        try:
            self._announce()
            self._announced = True
            while not self._over.is_set() and not self._arrived:
                self._ask()
                self._over.wait(_POLL_S)
        except (ModelError, ModelLostError) as error:
            self._error = error
        except Exception as error:  # of the operating system, while a command starts
            self._error = ModelError(f"the stack cannot be announced: {error_line(error)}")
        self._over.wait()
        try:
            self._abort()
        except VsnbenchError as error:
            self._abort_error = str(error)
        except Exception as error:
            self._abort_error = error_line(error)

    def _announce(self) -> None:
        announce, timeout_s = self._stack.announce, self._stack.timeout_s
        if self._heard is not None:
            self._heard.begin(timeout_s)
        if announce.http is not None:
            post(announce.http, self._goal, self._stack.timeout_s)
        elif announce.command is not None:
            self._process = self._start(announce.command)
        elif announce.topic is not None:
            self._publish(announce.topic)
        elif announce.action is not None:
            action = announce.action
            self._action = self._network.send_goal(action.name, action.type, self._content(action), timeout_s)

    def _publish(self, message: ToTopic) -> None:
        self._network.publish(message.name, message.type, self._content(message), self._stack.timeout_s)

    def _content(self, message: ToTopic | ToAction) -> dict[str, Any]:
        return message.content_for(self._goal["goal"], self._goal.get("category", self._goal["goal"]))

    @property
    def _network(self) -> Exchange:
        if self._exchange is None:
            raise ModelError("the robot has no network of topics and actions", code="no-exchange")
        return self._exchange

    def _ask(self) -> None:
        arrived, process = self._stack.arrived, self._process
        if arrived.http is not None:
            state = get(arrived.http, self._stack.timeout_s)
            if failure := state.get("failed"):
                raise ModelError(f"the stack says that it failed: {sanitize(str(failure))[:200]}")
            if not isinstance(state.get("arrived"), bool):
                raise ModelError(f'the stack\'s answer at {arrived.http} has no "arrived": true or false')
            self._arrived = state["arrived"]
        elif self._heard is not None:
            self._arrived = self._heard.has_arrived
        if self._action is not None and (outcome := self._action.outcome):
            if outcome != "succeeded":
                raise ModelError(f"the stack's action ended: {outcome}")
            self._arrived = self._arrived or arrived.action is True
        if process is None or (code := process.poll()) is None:
            return
        if arrived.exit_code is not None and code == arrived.exit_code:
            self._arrived = True
        elif arrived.exit_code is not None or code != 0:
            ended = f"by signal {-code}" if code < 0 else f"with exit code {code}"
            expected = "" if arrived.exit_code is None else f", and {arrived.exit_code} says that it arrived"
            raise ModelError(f"the command of the stack ended {ended}{expected}")

    def _abort(self) -> None:
        abort, process = self._stack.abort, self._process
        if abort is not None and abort.http is not None:
            post(abort.http, None, self._stack.timeout_s)
        elif abort is not None and abort.command is not None:
            code = self._start(abort.command).wait(self._stack.timeout_s)
            if code != 0:
                raise ModelError(f"the command of `abort` ended with exit code {code}")
        elif abort is not None and abort.topic is not None:
            self._publish(abort.topic)
        if self._action is not None:
            self._action.cancel(self._stack.timeout_s)
        if process is not None:
            _end(process)

    def _start(self, command: list[str]) -> "subprocess.Popen[bytes]":
        """Start a program in a session of its own, which ends at the latest with this trial's thread."""
        name, *arguments = (word.replace(GOAL_WORD, str(self._goal["goal"])) for word in command)
        program = shutil.which(self._directory / name if "/" in name else name)
        if program is None:
            raise ModelError(f"cannot start {sanitize(name)}: program not found", code="no-stack-program")
        return subprocess.Popen(
            command_that_ends_with_parent([str(Path(program).absolute()), *arguments]),
            stdin=subprocess.DEVNULL,
            stdout=2,  # stdout is for results
            cwd=self._directory,
            start_new_session=True,
        )


def _end(process: "subprocess.Popen[bytes]") -> None:
    """End a program and everything that it started in its session."""
    for number in (signal.SIGINT, signal.SIGKILL):
        try:
            os.killpg(process.pid, number)
        except ProcessLookupError:
            break
        try:
            process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            continue
    process.poll()
