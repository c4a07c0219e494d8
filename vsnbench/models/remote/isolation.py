"""Starts a model in a process of its own, perhaps with another Python, and ends it with the run.

The process listens on a socket file in a directory that only this user can enter. It may use so much memory and no
more, dies with us, and what it writes on stderr goes to our log.
"""

import contextlib
import logging
import os
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Self

from vsnbench.errors import ModelError, ModelLostError, UsageError
from vsnbench.harmless_text import harmless
from vsnbench.models.remote import vsnbench_policy
from vsnbench.models.remote.connection import Answer, Connection
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.scratch import ScratchDirectory
from vsnbench.workers import command_that_ends_with_parent

logger = logging.getLogger(__name__)

START_TIMEOUT_S = 120.0
"""Loading a large checkpoint on a cold disk takes its time."""
_TERMINATE_S = 3.0
_LAST_LINES = 20
_END_PATIENCE_S = 1.0
"""A connection breaks a moment before its process is seen to have ended."""


@dataclass(frozen=True, slots=True)
class Isolation:
    """How a model's own process is made."""

    python: Path | None = None
    """The interpreter of the model's environment, which needs numpy, msgpack and websockets and not vsnbench; ours
    when None."""
    memory_bytes: int | None = None
    """How much memory it may have; no limit when None."""


class IsolatedProcess:
    """A running model server of our own."""

    def __init__(self, process: subprocess.Popen[bytes], scratch: ScratchDirectory, name: str) -> None:
        self._process = process
        self._scratch = scratch
        self._name = name
        self._last_lines: deque[str] = deque(maxlen=_LAST_LINES)
        self._reader = threading.Thread(target=self._pass_on, name=f"stderr of {name}", daemon=True)
        self._reader.start()

    @classmethod
    def start(
        cls,
        model: str,
        options: Mapping[str, Any],
        isolation: Isolation,
        timeout_s: float = START_TIMEOUT_S,
    ) -> Self:
        """Start a model's server and wait until it listens.

        Args:
            model: a built-in model or `package.module:Class`.
            options: its options, as `create_policy` takes them; none with another Python.
            isolation: with which interpreter and limits.
            timeout_s: how long it may take to load.

        Raises:
            UsageError: the interpreter does not exist, or the options are not for another Python.
            ModelError: it ended, or does not listen in time.
        """
        scratch = ScratchDirectory("model")
        socket_file = scratch.path / "model.sock"
        try:
            command = _command(model, options, isolation.python, socket_file)
            process = subprocess.Popen(
                command_that_ends_with_parent(command),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                env=_environment(),
                start_new_session=True,  # Ctrl-C is for the run, which ends the model when the robot stands
            )
            if isolation.memory_bytes is not None:
                limit = (isolation.memory_bytes, isolation.memory_bytes)
                resource.prlimit(process.pid, resource.RLIMIT_DATA, limit)
        except (OSError, UsageError) as error:
            scratch.remove()
            if isinstance(error, UsageError):
                raise
            raise UsageError(
                f"model {model}: cannot start {isolation.python or sys.executable}: {error.strerror}"
            ) from error
        started = cls(process, scratch, model)
        try:
            started._wait_for(socket_file, timeout_s)
        except BaseException:
            started.close()
            raise
        return started

    @property
    def pid(self) -> int:
        """The process."""
        return self._process.pid

    @property
    def socket_file(self) -> str:
        """Where it listens."""
        return str(self._scratch.path / "model.sock")

    @property
    def death(self) -> str | None:
        """How the process ended, in words; None while it lives."""
        code = self._process.poll()
        if code is None:
            return None
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        last = f", its last words: {self._last_lines[-1]}" if self._last_lines else ""
        return f"the process of model {self._name} has ended with {how}{last}"

    def wait_for_death(self) -> str | None:
        """Return how the process ended, giving one that is just about to a moment; None where it lives on."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_PATIENCE_S)
            self._reader.join(_END_PATIENCE_S)
        return self.death

    def close(self) -> None:
        """End the process and everything that it started; returns when it is gone."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_TERMINATE_S)
        self.kill()

    def kill(self) -> None:
        """End it without asking, as is right for one that does not answer."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_TERMINATE_S)
        self._reader.join(1.0)
        self._scratch.remove()

    def _where_it_is(self, last: str) -> str:
        """Return what to do about a module that is not found; empty where something else is wrong."""
        module = self._name.partition(":")[0]
        missing = last.rpartition("No module named ")[2].strip("'")
        if "ModuleNotFoundError" not in last or not f"{module}.".startswith(f"{missing}."):
            return ""
        return f"it is not in {Path.cwd()}: go to the directory that has {module.replace('.', '/')}.py in it"

    def _wait_for(self, socket_file: Path, timeout_s: float) -> None:
        give_up = time.monotonic() + timeout_s
        while not socket_file.exists():
            if self._process.poll() is not None:
                self._reader.join(1.0)
                last = self._last_lines[-1] if self._last_lines else f"exit code {self._process.returncode}"
                raise ModelError(
                    f"model {self._name} did not start in its own process: {last}", advice=self._where_it_is(last)
                )
            if time.monotonic() > give_up:
                raise ModelError(f"model {self._name} is not ready after {timeout_s:g} s in its own process")
            time.sleep(0.02)

    def _pass_on(self) -> None:
        stream = self._process.stderr
        if stream is None:
            return
        for line in iter(lambda: stream.readline(4096), b""):
            text = harmless(line.decode("utf-8", "replace").rstrip())
            if self.socket_file not in text:  # that it listens there says nothing about how it ended
                self._last_lines.append(text)
            logger.info("%s: %s", self._name, text)


class IsolatedPolicy(RemotePolicy):
    """A policy in a process of its own on this machine, which ends with it.

    A process that hung or died is lost with its episode; before the next one it is killed and another one started,
    which must have the same card.
    """

    def __init__(self, model: str, options: Mapping[str, Any], isolation: Isolation) -> None:
        """Start the process and connect.

        Args:
            model: a built-in model or `package.module:Class`.
            options: its own, and `act_timeout` for the connection.
            isolation: with which interpreter and limits.

        Raises:
            UsageError: the interpreter does not exist, or an option is not for it.
            ModelError: the model could not be started.
        """
        if model.startswith(("ws://", "wss://")):
            raise UsageError(f"model {model} is in a process of its own already", advice="leave --isolate away")
        own = {name: value for name, value in options.items() if name != "act_timeout"}
        self._start = partial(IsolatedProcess.start, model, own, isolation)
        self._process = self._start()
        try:
            super().__init__(
                model, act_timeout=options.get("act_timeout"), token="", unix_path=self._process.socket_file
            )
        except BaseException:
            self._process.close()
            raise

    @property
    def pid(self) -> int:
        """The process."""
        return self._process.pid

    def close(self) -> None:
        """End the process."""
        super().close()
        self._process.close()

    def _reconnect(self) -> Connection:
        how = self._process.death or f"the process of model {self.card.name} did not answer"
        logger.warning("%s: it is started again", how)
        self._process.kill()
        try:
            self._process = self._start()
            self._address = replace(self._address, unix_path=self._process.socket_file)
            return self.connect()
        except (ModelError, UsageError) as error:
            raise ModelLostError(error.statement, advice=error.advice) from error

    def _ask(self, connection: Connection, question: Mapping[str, Any], wanted: str, timeout_s: float) -> Answer:
        try:
            return super()._ask(connection, question, wanted, timeout_s)
        except ModelLostError as error:
            broke = not isinstance(error.__cause__, TimeoutError)
            if broke and (death := self._process.wait_for_death()):
                raise ModelLostError(f"{question['type']}: {death}") from error
            raise


def _command(model: str, options: Mapping[str, Any], python: Path | None, socket_file: Path) -> list[str]:
    if python is None:
        # -P: the working directory is looked into last, and only for a class that is named
        words = [
            sys.executable,
            "-P",
            "-m",
            "vsnbench.cli.main",
            "models",
            "serve",
            model,
            "--unix-path",
            str(socket_file),
        ]
        for name, value in options.items():
            words += [f"--{name.replace('_', '-')}", str(value)]
        return words
    if ":" not in model:
        raise UsageError("--python is for a model of your own", advice=f"name it as package.module:Class, not {model}")
    if options:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in options)
        raise UsageError(
            f"{names} cannot be handed to a model in another Python", advice="let its class read its own settings"
        )
    found = shutil.which(str(python.expanduser()))
    if found is None:
        raise UsageError(f"there is no interpreter {python}", advice="give --python /path/to/env/bin/python")
    # A copy beside the socket: a script's own directory is looked into first, and ours is full of modules.
    stub = socket_file.parent / "vsnbench_policy.py"
    shutil.copyfile(vsnbench_policy.__file__, stub)
    return [found, str(stub), model, "--unix-path", str(socket_file)]


def _environment() -> dict[str, str]:
    """Return our environment without what belongs to our own interpreter and its record."""
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONHOME", "VIRTUAL_ENV")}
    return {**kept, "PYTHONUNBUFFERED": "1"}
