"""A pool of workers on this machine: started, watched, replaced when they die, and never left behind."""

import logging
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from types import TracebackType
from typing import Self

from vsnbench.database.campaign_plan import Trial
from vsnbench.database.journal import Journal
from vsnbench.errors import VsnbenchError
from vsnbench.runner.bench import BenchDescription, BenchPlan
from vsnbench.runner.pool.capacity import Capacity, Wish, chosen
from vsnbench.runner.pool.contract import ActionsTaken, EpisodeKept, PoolEvent, WorkerLost
from vsnbench.runner.pool.messages import (
    Acted,
    Ended,
    Free,
    Keeping,
    Order,
    Prepare,
    Prepared,
    Refused,
    Report,
    RunTrial,
    Stop,
)
from vsnbench.runner.pool.process import WorkerProcess, fork_server
from vsnbench.runner.stopping import StopRequest

logger = logging.getLogger(__name__)

LOST_BEFORE_READY = 3
"""After so many workers that died before one was ready, or processes to fork one from, another would die too."""
STOP_TIMEOUT_S = 20.0
"""How long workers may take to end their episodes: an action and a commit, on a busy machine."""


class LocalWorker:
    """A worker's process, seen from the driver."""

    def __init__(self, process: WorkerProcess) -> None:
        self.process = process
        self.connection: Connection[Order, Report] = Connection(process.socket.detach())
        self.prepared: Prepared | None = None
        self.trial: Trial | None = None
        self._benches_ordered = 0
        """And not yet answered: in a sweep a campaign may be over before each of its workers has made its bench."""

    @property
    def is_free(self) -> bool:
        """Whether it waits for a trial."""
        return self.prepared is not None and self.trial is None

    def tell(self, order: Order) -> None:
        """Send an order; one that is gone is noticed where its reports are read."""
        try:
            self.connection.send(order)
        except OSError:
            logger.debug("worker %d is gone", self.process.pid)

    def have_make(self, order: Prepare) -> None:
        """Have it make a bench, as soon as it has done what it was told before."""
        self.prepared = None
        self._benches_ordered += 1
        self.tell(order)

    def has_made(self, prepared: Prepared) -> bool:
        """Take its answer to the order of a bench; return whether it is the one that was ordered last."""
        self._benches_ordered -= 1
        if self._benches_ordered == 0:
            self.prepared = prepared
        return self.prepared is not None

    def bury(self) -> str:
        """End it where it has not ended yet, and say how it ended."""
        code = self.process.bury()
        self.connection.close()
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"


class LocalPool:
    """Workers on this machine; a context manager that leaves none behind."""

    def __init__(self, plan: BenchPlan, wish: Wish) -> None:
        """Start the workers, and find out how many the machine holds; arguments and errors as for `prepare`."""
        self._workers: list[LocalWorker] = []
        self._events: deque[PoolEvent] = deque()
        self._capacity = Capacity.of_this_machine()
        self._server = fork_server()
        self.prepare(plan, wish)

    def prepare(self, plan: BenchPlan, wish: Wish) -> None:
        """Have the workers make a bench, and be as many as are wanted; those that are there make another one.

        Args:
            plan: what the next trials are run with; none is being run now.
            wish: how many workers somebody wants.

        Raises:
            UsageError: more were asked for than the machine's memory holds, or the plan does not fit together.
            VsnbenchError: the bench cannot be made.
        """
        self._order = Prepare(plan, tuple(sys.argv))
        capacity = self._capacity
        try:
            for worker in self._workers:
                worker.have_make(self._order)
            self._start(capacity.at_first(wish, plan.model_options.get("device")) - len(self._workers))
            first = self._await_first()
            self._description = first.description
            self._count = chosen(wish, capacity, first, len(self._workers))
            self._workers.sort(key=lambda worker: worker.prepared is None)  # who is ready stays
            for surplus in self._workers[self._count :]:
                surplus.bury()
            del self._workers[self._count :]
            self._start(self._count - len(self._workers))
            self._words = capacity.words(self._count, first)
        except BaseException:
            self.kill()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()

    @property
    def description(self) -> BenchDescription:
        """What their benches say of themselves."""
        return self._description

    @property
    def words(self) -> str:
        """How many workers there are, and why."""
        return self._words

    @property
    def free(self) -> int:
        """How many trials can be begun now."""
        return sum(worker.is_free for worker in self._workers)

    @property
    def busy(self) -> int:
        """How many trials are being run."""
        return sum(worker.trial is not None for worker in self._workers)

    def begin(self, journal: Journal, trial: Trial, keeping: Keeping) -> None:
        """Have a free worker claim a trial, run it and keep it."""
        del journal
        worker = next(worker for worker in self._workers if worker.is_free)
        worker.trial = trial
        worker.tell(RunTrial(trial, keeping, cores_left=self._count < self._capacity.cores))

    def events(self, timeout_s: float) -> Sequence[PoolEvent]:
        """Return what has happened, as soon as something has.

        Raises:
            VsnbenchError: a worker says that what was ordered cannot be done.
        """
        by_connection = {worker.connection: worker for worker in self._workers}
        for ready in wait(list(by_connection), timeout_s):
            worker = by_connection[ready]  # type: ignore[index]
            try:
                self._heard(worker, worker.connection.recv())
            except (EOFError, OSError):
                self._lost(worker)
        happened = list(self._events)
        self._events.clear()
        return happened

    def stop(self, request: StopRequest) -> None:
        """Have every running episode end as somebody asks; returns when all workers are gone."""
        give_up_s = time.monotonic() + STOP_TIMEOUT_S
        at_work = [worker for worker in self._workers if worker.trial is not None]
        for worker in at_work:
            worker.tell(Stop(request))
        while at_work and (left_s := give_up_s - time.monotonic()) > 0:
            for ready in wait([worker.connection for worker in at_work], left_s):
                worker = next(one for one in at_work if one.connection is ready)
                if not _still_talks(worker.connection):
                    at_work.remove(worker)
        self.kill()

    def kill(self) -> None:
        """End all workers at once."""
        self._server.end()
        while self._workers:
            self._workers.pop().connection.close()

    def _start(self, count: int) -> None:
        for _ in range(count):
            worker = LocalWorker(self._forked())
            self._workers.append(worker)
            worker.have_make(self._order)

    def _forked(self) -> WorkerProcess:
        for _ in range(LOST_BEFORE_READY):
            try:
                return self._server.fork()
            except ConnectionError:  # somebody has killed it, and its workers with it
                self._server.end()
                self._server = fork_server()
        raise VsnbenchError(
            f"no worker can be started: {LOST_BEFORE_READY} processes that were to fork one ended before they did",
            advice="one said why above, or somebody ended them; the same command goes on",
        )

    def _await_first(self) -> Prepared:
        lost = 0
        while True:
            for event in self.events(1.0):
                lost += isinstance(event, WorkerLost)
                if isinstance(event, WorkerLost) and lost == LOST_BEFORE_READY:
                    raise VsnbenchError(
                        f"{lost} workers ended while they got ready, the last with {event.words}",
                        advice="it said why above, or the system ended it for want of memory: try --workers 1",
                    )
            for worker in self._workers:
                if worker.prepared is not None:
                    return worker.prepared

    def _heard(self, worker: LocalWorker, report: Report) -> None:
        match report:
            case Prepared() as prepared:
                if worker.has_made(prepared) and self._workers_differ(prepared):
                    raise VsnbenchError("two workers made of the same plan differ: " + self._workers_differ(prepared))
            case Acted(actions):
                self._events.append(ActionsTaken(actions))
            case Ended(number, trial, outcome):
                self._events.append(EpisodeKept(number, trial, outcome))
            case Free():
                worker.trial = None
            case Refused(error):
                raise error

    def _workers_differ(self, prepared: Prepared) -> str:
        others = [one.prepared for one in self._workers if one.prepared is not None]
        return others[0].description.difference(prepared.description) if others else ""

    def _lost(self, worker: LocalWorker) -> None:
        how = worker.bury()
        self._workers.remove(worker)
        self._events.append(WorkerLost(worker.trial, how))
        self._start(1)


class SharedWorkers:
    """Workers of this machine that run one campaign after another; a context manager that leaves none behind."""

    def __init__(self) -> None:
        self._pool: LocalPool | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End them."""
        pool, self._pool = self._pool, None
        if pool is not None:
            pool.kill()

    @contextmanager
    def made_ready(self, plan: BenchPlan, wish: Wish) -> Iterator[LocalPool]:
        """Have them ready for a campaign; after any error nobody goes on with them.

        Raises:
            UsageError: more were asked for than memory holds, or the plan does not fit together.
            VsnbenchError: the bench cannot be made.
        """
        try:
            if self._pool is None:
                self._pool = LocalPool(plan, wish)
            else:
                self._pool.prepare(plan, wish)
            yield self._pool
        except BaseException:
            self.close()
            raise


def _still_talks(connection: "Connection[Order, Report]") -> bool:
    """Drop what a worker still says; False when it is gone."""
    try:
        return bool(os.read(connection.fileno(), 1 << 16))
    except OSError:
        return False
