"""A local worker process: makes a trial setup and runs the trials that the driver orders.

It writes each step to the results database itself, as a run in one process does. Ctrl-C reaches only the driver; the
worker ends when the driver does.
"""

import queue
import threading
import time
from contextlib import ExitStack
from multiprocessing.connection import Connection
from os import _exit as end_process_now

import psutil

from vsnbench.errors import VsnbenchError
from vsnbench.models.checkpoints.torch_runtime import gpu_memory
from vsnbench.protocol.free_space import free_space
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.episode.depth_guard import get_ready
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.executors.in_process import InProcessExecutor
from vsnbench.runner.executors.messages import Order, Prepare, Prepared, Report, RunTrial
from vsnbench.runner.loop.contract import ActionsTaken, Session
from vsnbench.runner.operator.contract import AbsentOperator, EndedEpisode
from vsnbench.runner.setup.trial_setup import SetupDescription, TrialSetup, TrialSetupSpec, open_trial_setup
from vsnbench.runner.stopping.requests import Stopped, StopRequest, StopRequests
from vsnbench.text.log_output import opened_log
from vsnbench.text.streams import sanitized_output

REPORT_EVERY_S = 0.25
"""Update interval of the progress display."""


def main(descriptor: str) -> None:
    """Work for the driver at the socket with this file descriptor until it sends a stop."""
    with sanitized_output(), opened_log():
        _work(Connection(int(descriptor)))


def _work(connection: "Connection[Report, Order]") -> None:
    with StopRequests() as stop, ExitStack() as stack:
        worker = Worker(connection, stop, stack)
        try:
            worker.work()
        except VsnbenchError as error:
            connection.send(error)
        except (Stopped, BrokenPipeError):
            return


class Worker:
    """Carries out the driver's orders in the main thread."""

    def __init__(self, connection: "Connection[Report, Order]", stop: StopRequests, stack: ExitStack) -> None:
        self._connection = connection
        self._stop = stop
        self._stack = stack
        self._orders: queue.SimpleQueue[Order] = queue.SimpleQueue()
        self._order: Prepare | None = None
        self._setup: TrialSetup | None = None
        self._session: Session | None = None
        """The session in which this process runs the driver's trials, once there is one."""
        threading.Thread(target=self._listen, name="orders", daemon=True).start()

    def work(self) -> None:
        """Carry out orders.

        Raises:
            Stopped: the driver sent a stop.
            VsnbenchError: an order cannot be carried out.
        """
        while True:
            match self._orders.get():
                case Prepare() as order:
                    self._prepare(order)
                case RunTrial(trial, recording):
                    session = self._session = self._session or self._begin_session(recording)
                    session.recording = recording
                    executor = session.robots
                    self._connection.send(tuple(executor.events()) if executor.begin(trial) else ())
                case StopRequest() as request:
                    raise Stopped(request)

    def _listen(self) -> None:
        """Receive orders while the main thread works; end the process when the driver is gone."""
        while True:
            try:
                order = self._connection.recv()
            except (EOFError, OSError):
                end_process_now(1)
            if isinstance(order, StopRequest):
                self._stop.ask(order)
            self._orders.put(order)

    def _prepare(self, order: Prepare) -> None:
        self._stack.close()
        self._setup = self._session = None
        self._setup, self._order = self._stack.enter_context(open_trial_setup(order.spec)), order
        self._stop.last_acts[:] = [self._setup.robot.halt]
        description, own_bytes = self._setup.description, psutil.Process().memory_full_info().uss
        # A model that only tried the GPU has left something there, too: the next process then avoids it.
        gpu = gpu_memory() if description.on_gpu and description.sessions is None else None
        self._connection.send(Prepared(description, own_bytes, gpu))
        # The driver opens the results database now; meanwhile this process loads what the first trial needs.
        _load_for_trials(description, order.spec)

    def _begin_session(self, recording: RecordingOptions) -> Session:
        if self._setup is None or self._order is None:
            raise RuntimeError("a trial was ordered before a trial setup")
        setup, spec = self._setup, self._order.spec
        provenance = setup.provenance(self._order.command)
        journal = self._stack.enter_context(Journal.open(recording.results.database_url, provenance))
        journal.patience.gives_up = lambda: self._stop.session_ends
        session = Session(
            journal=journal,
            robots=InProcessExecutor.of_setup(setup),
            recording=recording,
            site=spec.site,
            parameters=spec.parameters,
            disturbances=spec.disturbances,
            stop_requests=self._stop,
            operator=_Reporter(self._connection),
        )
        session.robots.session_begins(session)
        return session


def _load_for_trials(description: SetupDescription, spec: TrialSetupSpec) -> None:
    profile = description.robot.profile
    get_ready(profile.camera, profile.base, spec.parameters.depth_guard)
    free_space(spec.site, profile.base.radius_m).geodesic_field_m(description.goals[0], spec.parameters)


class _Reporter(AbsentOperator):
    """Reports actions to the driver."""

    def __init__(self, connection: "Connection[Report, Order]") -> None:
        super().__init__()
        self._connection = connection
        self._unreported = 0
        self._reported_s = time.monotonic()

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Report several actions at once: each report takes a core from a worker."""
        del plan, step
        self._unreported += 1
        if time.monotonic() - self._reported_s >= REPORT_EVERY_S:
            self._report()

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Report the last actions."""
        del ended
        self._report()

    def _report(self) -> None:
        if self._unreported:
            self._connection.send(ActionsTaken(self._unreported))
        self._unreported, self._reported_s = 0, time.monotonic()
