"""Runs a model in a separate process on this machine, optionally with another Python interpreter.

The process listens on a socket file in a directory that only this user can enter. It can have a memory limit, ends with
this process, and its stderr goes to the log.
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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Self

import psutil

from vsnbench.errors import ModelError, ModelLostError, UsageError
from vsnbench.files.home import expanded
from vsnbench.files.temporary import ScratchDirectory
from vsnbench.models.names import is_address
from vsnbench.models.remote import vsnbench_policy
from vsnbench.models.remote.connection import Connection, ServerAnswer
from vsnbench.models.remote.peer import ModelBusyError
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.runtime.child_process import command_that_ends_with_parent, hide_memory
from vsnbench.runtime.hide_files import can_hide_files, command_without
from vsnbench.text.sanitize import sanitize

logger = logging.getLogger(__name__)

START_TIMEOUT_S = 120.0
"""Time for loading a large checkpoint from a cold disk."""
_TERMINATE_S = 3.0
_LAST_LINES = 20
_STUB_PACKAGES = ("numpy", "msgpack", "websockets")
_TRANSPORT_CODES = ("not-a-model-server", "connection-lost", "no-server")
"""Codes of errors that the packages of the model's environment cause: no model has answered."""
_END_PATIENCE_S = 1.0
"""A connection breaks shortly before the end of its process is visible."""


@dataclass(frozen=True, slots=True)
class Isolation:
    """Settings of a model's process."""

    python: Path | None = None
    """Interpreter of the model's environment, which needs numpy, msgpack and websockets; None for this interpreter."""
    memory_bytes: int | None = None
    """Memory limit; None for no limit."""
    hidden: tuple[Path, ...] = ()
    """Files and directories that the process cannot read."""


class IsolatedProcess:
    """A model's server, started by this process."""

    def __init__(self, process: subprocess.Popen[bytes], scratch: ScratchDirectory, name: str, python: Path) -> None:
        self.python = python
        self._process = process
        self._scratch = scratch
        self._name = name
        self._last_lines: deque[str] = deque(maxlen=_LAST_LINES)
        self._reader = threading.Thread(target=self._log_stderr, name=f"stderr of {name}", daemon=True)
        self._reader.start()

    @classmethod
    def start(
        cls, model: str, options: Mapping[str, Any], isolation: Isolation, timeout_s: float = START_TIMEOUT_S
    ) -> Self:
        """Start a model's server and wait until it listens. Options are the arguments of the model's constructor.

        Raises:
            UsageError: the interpreter does not exist, or there are options for another interpreter.
            ModelError: the process ended, or does not listen in time.
        """
        hide_memory()
        if isolation.hidden and not can_hide_files():
            raise UsageError(
                "this kernel cannot hide the results from a model: it has no Landlock of Linux 5.19",
                advice="leave hide_results out of [isolation] in vsnbench.toml, or serve the model from a container",
                code="no-landlock",
            )
        scratch = ScratchDirectory("model")
        socket_file = scratch.path / "model.sock"
        try:
            command = _command(model, options, isolation.python, socket_file)
            environment = _environment()
            if isolation.hidden:
                command = command_without(isolation.hidden, command)
                environment["TMPDIR"] = str(scratch.path)  # what it writes beside the results it could not read
            process = subprocess.Popen(
                command_that_ends_with_parent(command, unprivileged=True),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                env=environment,
                start_new_session=True,  # Ctrl-C goes to the run, which ends the model after the robot has stopped
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
        started = cls(process, scratch, model, isolation.python or Path(sys.executable))
        try:
            started._wait_for(socket_file, timeout_s)
        except BaseException:
            started.close()
            raise
        return started

    @property
    def pid(self) -> int:
        """Process ID."""
        return self._process.pid

    @property
    def socket_file(self) -> str:
        """Socket file of the server."""
        return str(self._scratch.path / "model.sock")

    @property
    def death(self) -> str | None:
        """Description of how the process ended; None while it runs."""
        code = self._process.poll()
        if code is None:
            return None
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        last = f"; last line of stderr: {self.last_line}" if self.last_line else ""
        return f"the process of model {self._name} ended with {how}{last}"

    @property
    def last_line(self) -> str:
        """Last line that the process wrote to stderr, or an empty string."""
        return self._last_lines[-1] if self._last_lines else ""

    @property
    def packages_advice(self) -> str:
        """The command that installs the packages that the server file needs."""
        return f"`{self.python} -m pip install -U numpy 'msgpack>=1.0' 'websockets>=11'`"

    def wait_for_death(self) -> str | None:
        """Wait a moment for the end of the process. Returns how it ended, or None if it still runs."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_PATIENCE_S)
            self._reader.join(_END_PATIENCE_S)
        return self.death

    def close(self) -> None:
        """End the process and all processes that it started, and wait for them."""
        started = self._started()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_TERMINATE_S)
        self.kill(started)

    def kill(self, started: Sequence[psutil.Process] = ()) -> None:
        """Kill the process and all processes that it started; `started` were found while it was running."""
        for process in (*started, *self._started()):
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_TERMINATE_S)
        self._reader.join(1.0)
        self._scratch.remove()

    def _started(self) -> list[psutil.Process]:
        """Return the processes that it started, including those in other groups and sessions."""
        try:
            return psutil.Process(self._process.pid).children(recursive=True)
        except psutil.NoSuchProcess:
            return []

    def _start_advice(self, last: str) -> str:
        """Return advice about a module that was not found, or an empty string."""
        module = self._name.partition(":")[0]
        missing = last.rpartition("No module named ")[2].strip("'")
        if missing.partition(".")[0] in _STUB_PACKAGES:
            return self.packages_advice
        if "ModuleNotFoundError" not in last or not f"{module}.".startswith(f"{missing}."):
            return ""
        return f"it is not in {Path.cwd()}: go to the directory that has {module.replace('.', '/')}.py in it"

    def _wait_for(self, socket_file: Path, timeout_s: float) -> None:
        give_up = time.monotonic() + timeout_s
        while not socket_file.exists():
            if self._process.poll() is not None:
                self._reader.join(1.0)
                last = self.last_line or f"exit code {self._process.returncode}"
                raise ModelError(
                    f"model {self._name} did not start in a separate process: {last}", advice=self._start_advice(last)
                )
            if time.monotonic() > give_up:
                raise ModelError(f"model {self._name} is not ready after {timeout_s:g} s in a separate process")
            time.sleep(0.02)

    def _log_stderr(self) -> None:
        stream = self._process.stderr
        if stream is None:
            return
        for line in iter(lambda: stream.readline(4096), b""):
            text = sanitize(line.decode("utf-8", "replace").rstrip())
            if self.socket_file not in text:  # not the line that announces the socket
                self._last_lines.append(text)
            logger.info("%s: %s", self._name, text)


class IsolatedPolicy(RemotePolicy):
    """A policy in a separate process on this machine.

    If the process hangs or dies, its episode is void. A new process, which must have the same card, replaces it before
    the next episode.
    """

    def __init__(self, model: str, options: Mapping[str, Any], isolation: Isolation) -> None:
        """Start the process and connect.

        Options are the arguments of the model's constructor.

        Raises:
            UsageError: the interpreter does not exist, or there are options for another interpreter.
            ModelError: the model cannot be started.
        """
        if is_address(model):
            raise UsageError(f"model {model} already runs in another process", advice="leave --isolate out")
        self._start = partial(IsolatedProcess.start, model, options, isolation)
        self._process = self._start()
        try:
            super().__init__(model, token="", unix_path=self._process.socket_file)
        except BaseException:
            self._process.close()
            raise

    @property
    def pid(self) -> int:
        """Process ID."""
        return self._process.pid

    def connect(self) -> Connection:
        """Return a new connection to the process.

        Raises:
            ModelBusyError: another client uses the model.
            ModelError: the process ended, or sent no card.
        """
        try:
            return super().connect()
        except ModelBusyError:
            raise
        except (ModelLostError, ModelError) as error:
            if death := self._process.wait_for_death():
                raise ModelError(death) from error
            if error.code not in _TRANSPORT_CODES:
                raise
            last = f": {self._process.last_line}" if self._process.last_line else ""
            raise ModelError(
                f"model {self._address} started in a separate process, which sent no card{last}",
                advice=self._process.packages_advice,
            ) from error

    def close(self) -> None:
        """End the process."""
        super().close()
        self._process.close()

    def _reconnect(self) -> Connection:
        how = self._process.death or f"the process of model {self.card.name} did not answer"
        logger.warning("%s; starting it again", how)
        self._process.kill()
        try:
            self._process = self._start()
            self._address = replace(self._address, unix_path=self._process.socket_file)
            return self.connect()
        except (ModelError, UsageError) as error:
            raise ModelLostError(error.statement, advice=error.advice, code=error.code) from error

    def _ask(self, connection: Connection, request: Mapping[str, Any], expected: str, timeout_s: float) -> ServerAnswer:
        try:
            return super()._ask(connection, request, expected, timeout_s)
        except ModelLostError as error:
            broke = not isinstance(error.__cause__, TimeoutError)
            if broke and (death := self._process.wait_for_death()):
                raise ModelLostError(f"{request['type']}: {death}") from error
            raise


def _command(model: str, options: Mapping[str, Any], python: Path | None, socket_file: Path) -> list[str]:
    if python is None:
        # -P: the working directory is searched last, and only for a class named by the user
        command = [sys.executable, "-P", "-m", "vsnbench.cli.main", "models", "serve", model]
        command += ["--unix-path", str(socket_file)]
        for name, value in options.items():
            command += [f"--{name.replace('_', '-')}", str(value)]
        return command
    if ":" not in model:
        raise UsageError(
            "--isolate PYTHON does not apply to built-in models", advice=f"name it as package.module:Class, not {model}"
        )
    if options:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in options)
        raise UsageError(
            f"{names} cannot be passed to a model with another interpreter", advice="let its class read its settings"
        )
    found = shutil.which(str(expanded(python)))
    if found is None:
        raise UsageError(
            f"no interpreter {python}", advice="write --isolate /path/to/env/bin/python", code="no-interpreter"
        )
    # A copy next to the socket, because Python searches a script's directory first.
    stub = socket_file.parent / "vsnbench_policy.py"
    shutil.copyfile(vsnbench_policy.__file__, stub)
    return [found, str(stub), model, "--unix-path", str(socket_file)]


def _environment() -> dict[str, str]:
    """Return the environment without the variables of this interpreter and without the token.

    The token is for servers that other machines reach. A model must not read it, and would expect it from this process.
    """
    left_out = ("PYTHONHOME", "VIRTUAL_ENV", vsnbench_policy.TOKEN_VARIABLE)
    variables = {name: value for name, value in os.environ.items() if name not in left_out}
    return {**variables, "PYTHONUNBUFFERED": "1"}
