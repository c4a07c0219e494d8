"""A pool of worker processes on this machine: starts, watches and replaces them, and ends them all at the end."""

import logging
import os
import shlex
import signal
import sys
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from typing import Self

from vsnbench.errors import VsnbenchError
from vsnbench.results.writing.campaigns import Trial
from vsnbench.runner.executors.capacity import Capacity, WorkerRequest, choose_count
from vsnbench.runner.executors.messages import Order, Prepare, Prepared, Report, RunTrial
from vsnbench.runner.executors.pool import TrialPool
from vsnbench.runner.executors.process import WorkerProcess, fork_server
from vsnbench.runner.loop.contract import ActionsTaken, LoopEvent, TrialReturned
from vsnbench.runner.setup.trial_setup import TrialSetupSpec
from vsnbench.runner.stopping.requests import StopRequest

logger = logging.getLogger(__name__)

LOST_BEFORE_READY = 3
"""Workers or fork servers lost before one is ready that end the attempt to start a pool."""
STOP_TIMEOUT_S = 20.0
"""Time for workers to end their episodes: an action and a commit, on a busy machine."""


class LocalWorker:
    """A worker process, seen from the driver."""

    def __init__(self, process: WorkerProcess) -> None:
        self.process = process
        self.connection: Connection[Order, Report] = Connection(process.socket.detach())
        self.prepared: Prepared | None = None
        self.trial: Trial | None = None
        self._setups_pending = 0
        """Setups ordered and not reported. In a sweep, a campaign can end before each worker has made its setup."""

    @property
    def is_free(self) -> bool:
        """Whether it waits for a trial."""
        return self.prepared is not None and self.trial is None

    def send(self, order: Order) -> None:
        """Send an order. A lost worker is detected where its reports are read."""
        try:
            self.connection.send(order)
        except OSError:
            logger.debug("worker %d is gone", self.process.pid)

    def order_setup(self, order: Prepare) -> None:
        """Have it make a trial setup after its earlier orders."""
        self.prepared = None
        self._setups_pending += 1
        self.send(order)

    def accept_setup(self, prepared: Prepared) -> bool:
        """Register a finished setup. Returns whether it is the latest that was ordered."""
        self._setups_pending -= 1
        if self._setups_pending == 0:
            self.prepared = prepared
        return self.prepared is not None

    def end(self) -> str:
        """End the process if it runs, and return how it ended."""
        code = self.process.end()
        self.connection.close()
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"


class LocalPool(TrialPool):
    """Worker processes on this machine."""

    def __init__(self, spec: TrialSetupSpec, request: WorkerRequest) -> None:
        """Start the workers, and measure how many fit into memory; arguments and errors as for `prepare`."""
        self._workers: list[LocalWorker] = []
        self._events: deque[LoopEvent] = deque()
        self._capacity = Capacity.of_this_machine()
        self._server = fork_server()
        self.prepare(spec, request)

    def prepare(self, spec: TrialSetupSpec, request: WorkerRequest) -> None:
        """Have the workers make a trial setup, and adjust their number. No trial may be running.

        Raises:
            UsageError: the requested workers do not fit into memory, or the spec is not consistent.
            VsnbenchError: the setup cannot be made.
        """
        self._order = Prepare(spec, shlex.join(sys.argv))
        capacity = self._capacity
        try:
            if request.first_alone:
                self._end_surplus(1)
            for worker in self._workers:
                worker.order_setup(self._order)
            self._start(capacity.initial_count(request, spec.options.get("device")) - len(self._workers))
            first = self._await_first()
            self.description = first.description
            self._count = choose_count(request, capacity, first, len(self._workers))
            self._workers.sort(key=lambda worker: worker.prepared is None)  # ready ones stay
            self._end_surplus(self._count)
            self._start(self._count - len(self._workers))
            self.summary = capacity.summary(self._count, first)
        except BaseException:
            self.halt()
            raise

    @property
    def free(self) -> int:
        """Number of trials that can begin now."""
        return sum(worker.is_free for worker in self._workers)

    @property
    def busy(self) -> int:
        """Number of trials that are running."""
        return sum(worker.trial is not None for worker in self._workers)

    def begin(self, trial: Trial) -> bool:
        """Have a free worker claim a trial, run it and record it, unless another process has claimed it."""
        worker = next(worker for worker in self._workers if worker.is_free)
        worker.trial = trial
        has_spare_cores = self._count < self._capacity.cores
        worker.send(RunTrial(trial, replace(self.session.recording, own_thread=has_spare_cores)))
        return True

    def reports(self, timeout_s: float) -> Sequence[LoopEvent]:
        """Return what has happened as soon as there is something, or nothing after the timeout."""
        by_connection = {worker.connection: worker for worker in self._workers}
        for ready in wait(list(by_connection), timeout_s):
            worker = by_connection[ready]  # type: ignore[index]
            try:
                self._receive(worker, worker.connection.recv())
            except (EOFError, OSError):
                self._replace(worker)
        happened = list(self._events)
        self._events.clear()
        return happened

    def stop(self, request: StopRequest) -> None:
        """End every running episode as requested; returns when all workers have ended."""
        give_up_s = time.monotonic() + STOP_TIMEOUT_S
        running = [worker for worker in self._workers if worker.trial is not None]
        for worker in running:
            worker.send(request)
        while running and (left_s := give_up_s - time.monotonic()) > 0:
            for ready in wait([worker.connection for worker in running], left_s):
                worker = next(worker for worker in running if worker.connection is ready)
                if not _discard_report(worker.connection):
                    running.remove(worker)
        self.halt()

    def halt(self) -> None:
        """End all workers at once."""
        self._server.end()
        while self._workers:
            self._workers.pop().connection.close()

    def _end_surplus(self, count: int) -> None:
        for surplus in self._workers[count:]:
            surplus.end()
        del self._workers[count:]

    def _start(self, count: int) -> None:
        for _ in range(count):
            worker = LocalWorker(self._fork())
            self._workers.append(worker)
            worker.order_setup(self._order)

    def _fork(self) -> WorkerProcess:
        for _ in range(LOST_BEFORE_READY):
            try:
                return self._server.fork()
            except ConnectionError:  # the server was killed, and its workers with it
                self._server.end()
                self._server = fork_server()
        raise VsnbenchError(
            f"no worker can be started: {LOST_BEFORE_READY} fork servers ended before they forked one",
            advice="the reason is above, unless a person ended them; repeat the command to continue",
            code="no-worker",
        )

    def _await_first(self) -> Prepared:
        lost = 0
        while True:
            for event in self.reports(1.0):
                lost += isinstance(event, TrialReturned)
                if isinstance(event, TrialReturned) and lost == LOST_BEFORE_READY:
                    raise VsnbenchError(
                        f"{lost} workers ended during their setup, the last with {event.lost_worker}",
                        advice="the reason is above, or the system had too little memory: try --workers 1",
                        code="no-worker",
                    )
            for worker in self._workers:
                if worker.prepared is not None:
                    return worker.prepared

    def _receive(self, worker: LocalWorker, report: Report) -> None:
        match report:
            case Prepared() as prepared:
                if worker.accept_setup(prepared) and (difference := self._difference(prepared)):
                    raise VsnbenchError(
                        f"two workers with the same spec have different setups: {difference}", code="worker-differs"
                    )
            case ActionsTaken():
                self._events.append(report)
            case tuple():
                worker.trial = None
                self._events.extend(report)
            case VsnbenchError():
                raise report

    def _difference(self, prepared: Prepared) -> str:
        others = [worker.prepared for worker in self._workers if worker.prepared is not None]
        return others[0].description.difference(prepared.description) if others else ""

    def _replace(self, worker: LocalWorker) -> None:
        cause = worker.end()
        self._workers.remove(worker)
        self._events.append(TrialReturned(worker.trial, cause))
        self._start(1)


class SharedWorkers:
    """Workers of this machine that run several campaigns; a context manager that ends them."""

    def __init__(self) -> None:
        self._pool: LocalPool | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the workers."""
        pool, self._pool = self._pool, None
        if pool is not None:
            pool.halt()

    @contextmanager
    def prepared(self, spec: TrialSetupSpec, request: WorkerRequest) -> Iterator[LocalPool]:
        """Prepare the workers for a campaign. Any error ends them.

        Raises:
            UsageError: the requested workers do not fit into memory, or the spec is not consistent.
            VsnbenchError: the setup cannot be made.
        """
        try:
            if self._pool is None:
                self._pool = LocalPool(spec, request)
            else:
                self._pool.prepare(spec, request)
            yield self._pool
        except BaseException:
            self.close()
            raise


def _discard_report(connection: "Connection[Order, Report]") -> bool:
    """Discard what a worker still sends. Returns False when its process has ended."""
    try:
        return bool(os.read(connection.fileno(), 1 << 16))
    except OSError:
        return False
