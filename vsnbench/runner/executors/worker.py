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
from vsnbench.results.writing.provenance import Provenance
from vsnbench.runner.episode.depth_guard import get_ready
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.executors.contract import ActionsTaken, EpisodeStored
from vsnbench.runner.executors.in_process import DrivingModel, InProcessExecutor, SingleModel
from vsnbench.runner.executors.messages import Free, Order, Prepare, Prepared, Refused, Report, RunTrial, Stop
from vsnbench.runner.loop.contract import ScheduledTrial
from vsnbench.runner.loop.session_context import SessionContext
from vsnbench.runner.operator.contract import AbsentOperator, EndedEpisode
from vsnbench.runner.setup.trial_setup import SetupDescription, TrialSetup, TrialSetupSpec, open_trial_setup
from vsnbench.runner.stopping.requests import Stopped, StopRequests
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
            connection.send(Refused(error))
        except (Stopped, BrokenPipeError):
            return


class Worker:
    """Carries out the driver's orders in the main thread."""

    def __init__(self, connection: "Connection[Report, Order]", stop: StopRequests, stack: ExitStack) -> None:
        self._connection = connection
        self._stop = stop
        self._stack = stack
        self._orders: queue.SimpleQueue[Order] = queue.SimpleQueue()
        self._spec: TrialSetupSpec | None = None
        self._setup: TrialSetup | None = None
        self._provenance: Provenance | None = None
        self._journal: Journal | None = None
        threading.Thread(target=self._listen, name="orders", daemon=True).start()

    def work(self) -> None:
        """Carry out orders.

        Raises:
            Stopped: the driver sent a stop.
            VsnbenchError: an order cannot be carried out.
        """
        while True:
            match self._orders.get():
                case Prepare(spec, command):
                    self._prepare(spec, command)
                case RunTrial() as order:
                    self._run(order)
                    self._connection.send(Free())
                case Stop(request):
                    raise Stopped(request)

    def _listen(self) -> None:
        """Receive orders while the main thread works; end the process when the driver is gone."""
        while True:
            try:
                order = self._connection.recv()
            except (EOFError, OSError):
                end_process_now(1)
            if isinstance(order, Stop):
                self._stop.ask(order.request)
            self._orders.put(order)

    def _prepare(self, spec: TrialSetupSpec, command: str) -> None:
        self._stack.close()
        self._setup = self._journal = None
        self._setup = self._stack.enter_context(open_trial_setup(spec))
        self._spec = spec
        self._stop.last_acts[:] = [self._setup.robot.halt]
        description, own_bytes = self._setup.description, psutil.Process().memory_full_info().uss
        # A model that only tried the GPU has left something there, too: the next process then avoids it.
        sessions = self._setup.sessions
        gpu = gpu_memory() if description.on_gpu and sessions is None else None
        self._connection.send(Prepared(description, own_bytes, gpu, sessions))
        # The driver opens the results database now; meanwhile this process loads what the first trial needs.
        self._provenance = self._setup.provenance(command)
        _load_for_trials(description, spec)

    def _run(self, order: RunTrial) -> None:
        if self._setup is None or self._spec is None or self._provenance is None:
            raise RuntimeError("a trial was ordered before a trial setup")
        setup, spec, recording = self._setup, self._spec, order.recording
        if self._journal is None:
            url = recording.results.database_url
            self._journal = self._stack.enter_context(Journal.open(url, self._provenance))
            self._journal.patience.gives_up = lambda: self._stop.session_ends
        context = SessionContext(
            self._journal,
            _Reporter(self._connection, order),
            self._stop,
            spec.site,
            spec.parameters,
            recording,
            spec.disturbances,
        )
        model = DrivingModel(setup.policy, setup.description.title)
        executor, trial = InProcessExecutor(context, setup.robot, SingleModel(model)), order.trial
        if executor.begin(ScheduledTrial(trial.campaign_id, trial.id)):
            executor.events()


def _load_for_trials(description: SetupDescription, spec: TrialSetupSpec) -> None:
    profile = description.robot.profile
    get_ready(profile.camera, profile.base, spec.parameters.depth_guard)
    free_space(spec.site, profile.base.radius_m).geodesic_field_m(description.goals[0], spec.parameters)


class _Reporter(AbsentOperator):
    """Reports actions and the end of the episode to the driver."""

    def __init__(self, connection: "Connection[Report, Order]", order: RunTrial) -> None:
        super().__init__()
        self._connection = connection
        self._order = order
        self._unreported = 0
        self._reported_s = time.monotonic()

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Report several actions at once: each report takes a core from a worker."""
        del plan, step
        self._unreported += 1
        if time.monotonic() - self._reported_s >= REPORT_EVERY_S:
            self._report()

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Report the outcome."""
        self._report()
        self._connection.send(EpisodeStored(ended.number, self._order.trial, ended.outcome))

    def _report(self) -> None:
        if self._unreported:
            self._connection.send(ActionsTaken(self._unreported))
        self._unreported, self._reported_s = 0, time.monotonic()
