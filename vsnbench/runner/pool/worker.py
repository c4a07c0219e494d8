"""A worker of this machine: a process with a bench of its own that runs the trials it is told to, one after another.

It writes into the record itself, every step as it happens, just as a run alone does. It hears nothing of Ctrl-C, which
is for the driver; when the driver is gone, so is it.
"""

import logging
import os
import queue
import shlex
import sys
import threading
import time
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from multiprocessing.connection import Connection

import psutil

from vsnbench.database.journal import Journal
from vsnbench.database.provenance import Provenance
from vsnbench.errors import VsnbenchError
from vsnbench.models.torch_runtime import gpu_memory
from vsnbench.protocol.free_space import free_space
from vsnbench.runner.attendant import EndedEpisode, Unattended
from vsnbench.runner.bench import Bench, BenchDescription, BenchPlan, open_bench
from vsnbench.runner.depth_guard import get_ready
from vsnbench.runner.episode import EpisodePlan, Step
from vsnbench.runner.pool.messages import Acted, Ended, Free, Order, Prepare, Prepared, Refused, Report, RunTrial, Stop
from vsnbench.runner.recorder import EpisodeRecorderFanOut, RecordingTarget
from vsnbench.runner.session import DrivingModel, Judged, Stage, VoidsInARow, run_trials
from vsnbench.runner.stopping import Stopped, Stopping

TELL_EVERY_S = 0.25
"""As often as the progress display draws itself."""


def main(descriptor: str) -> None:
    """Work until the driver says stop.

    Args:
        descriptor: the number of the socket to the driver.
    """
    logging.basicConfig(level=logging.WARNING, format="vsnbench: %(levelname)s: %(message)s", stream=sys.stderr)
    connection: Connection[Report, Order] = Connection(int(descriptor))
    with Stopping() as stop, ExitStack() as stack:
        worker = Worker(connection, stop, stack)
        try:
            worker.work()
        except VsnbenchError as error:
            connection.send(Refused(error))
        except (Stopped, BrokenPipeError):
            return


class Worker:
    """Carries out the driver's orders; the main thread's only."""

    def __init__(self, connection: "Connection[Report, Order]", stop: Stopping, stack: ExitStack) -> None:
        self._connection = connection
        self._stop = stop
        self._stack = stack
        self._orders: queue.SimpleQueue[Order] = queue.SimpleQueue()
        self._plan: BenchPlan | None = None
        self._bench: Bench | None = None
        self._provenance: Provenance | None = None
        self._journal: Journal | None = None
        threading.Thread(target=self._listen, name="orders", daemon=True).start()

    def work(self) -> None:
        """Carry out one order after another.

        Raises:
            Stopped: one of them was to stop.
            VsnbenchError: what was ordered cannot be done.
        """
        while True:
            match self._orders.get():
                case Prepare(plan, command):
                    self._prepare(plan, command)
                case RunTrial() as order:
                    self._run(order)
                    self._connection.send(Free())
                case Stop(request):
                    raise Stopped(request)

    def _listen(self) -> None:
        """Take orders while the main thread works; without a driver there is nothing to work for."""
        while True:
            try:
                order = self._connection.recv()
            except (EOFError, OSError):
                os._exit(1)
            if isinstance(order, Stop):
                self._stop.ask(order.request)
            self._orders.put(order)

    def _prepare(self, plan: BenchPlan, command: tuple[str, ...]) -> None:
        self._stack.close()
        self._bench = self._journal = None
        self._bench = self._stack.enter_context(open_bench(plan))
        self._plan = plan
        self._stop.last_acts[:] = [self._bench.robot.halt]
        described, own_bytes = self._bench.description, psutil.Process().memory_full_info().uss
        # A model that only tried the GPU has left something there, too: the next process knows not to.
        self._connection.send(Prepared(described, own_bytes, gpu_memory() if described.on_gpu else None))
        # The driver opens the record now: what the first trial needs is loaded meanwhile.
        self._provenance = self._bench.provenance(shlex.join(command))
        _load_for_trials(self._bench.description, plan)

    def _run(self, order: RunTrial) -> None:
        if self._bench is None or self._plan is None or self._provenance is None:
            raise RuntimeError("a trial was ordered before a bench")
        bench, plan, keeping = self._bench, self._plan, order.keeping
        if self._journal is None:
            url = keeping.results.database_url
            self._journal = self._stack.enter_context(Journal.open(url, self._provenance))
            self._journal.patience.gives_up = lambda: self._stop.session_ends
        target = RecordingTarget(
            self._journal,
            keeping.results,
            bench.description.title,
            bench.description.robot.profile,
            keeping.viewer,
            keeping.operator,
            plan.kept,
            beside=order.cores_left,
        )
        beside = Judged(self._journal, _Reporter(self._connection, order), keeping.operator)
        run_trials(
            Stage(self._journal, bench.robot, beside, self._stop),
            DrivingModel(bench.policy, partial(EpisodeRecorderFanOut, target)),
            replace(keeping.campaign, trials=(order.trial,)),
            plan.site,
            plan.parameters,
            VoidsInARow(),
        )


def _load_for_trials(described: BenchDescription, plan: BenchPlan) -> None:
    profile = described.robot.profile
    get_ready(profile.camera, profile.base, plan.parameters.depth_guard)
    free_space(plan.site, profile.base.radius_m).geodesic_field_m(described.goals[0], plan.parameters)


class _Reporter(Unattended):
    """Stands beside a worker's simulated robot for the driver: tells it everything and answers nothing."""

    def __init__(self, connection: "Connection[Report, Order]", order: RunTrial) -> None:
        self._connection = connection
        self._order = order
        self._untold = 0
        self._told_s = time.monotonic()

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Tell of actions, a few at a time: each report takes a core from a worker."""
        del plan, step
        self._untold += 1
        if time.monotonic() - self._told_s >= TELL_EVERY_S:
            self._tell()

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Tell how it ended."""
        self._tell()
        self._connection.send(Ended(ended.number, self._order.trial, ended.outcome))

    def _tell(self) -> None:
        if self._untold:
            self._connection.send(Acted(self._untold))
        self._untold, self._told_s = 0, time.monotonic()
