"""Chooses the number of workers: as requested, or as many as the machine's cores and memory allow."""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from vsnbench.errors import UsageError
from vsnbench.models.names import is_address, is_human
from vsnbench.robots.registry import is_simulated
from vsnbench.runner.executors.messages import Prepared
from vsnbench.runner.executors.ray_connection import ClusterAddress
from vsnbench.runner.setup.trial_setup import TrialSetupSpec
from vsnbench.runtime.resources import available_memory, granted_cores
from vsnbench.text.sanitize import counted

GIB = 2**30
AMPLE_BYTES = 3 * GIB
"""With this much free memory for each, workers start together. With less, one is measured first."""
RUNNING_BYTES = 400 * 2**20
"""Memory that an episode adds to a new trial setup: compiled code, images, Rerun, the database."""
_GPU_DEVICES = ("nvidia[0-9]*", "kfd")
"""Names in /dev of GPUs that PyTorch can use: NVIDIA's, AMD's."""
FEWEST_TRIALS = 10
"""Fewer trials run in the driver process, because a worker needs seconds to start."""


@dataclass(frozen=True, slots=True)
class WorkerOptions:
    """Options of the command line about workers."""

    count: int | None = 1
    """Maximum number of trials at once; None chooses from cores and memory, or takes a cluster's cores."""
    cluster: ClusterAddress | None = None
    """None for this machine."""
    gpus_each: float = 0.0
    """Share of a GPU that each worker of a cluster holds."""


@dataclass(frozen=True, slots=True)
class WorkerRequest:
    """Workers requested on this machine."""

    limit: int
    """Maximum number of workers."""
    is_explicit: bool
    """The user gave the number; otherwise memory may reduce it."""
    first_alone: bool = False
    """Start one worker before the others: its setup shows how many the model's server takes."""


@dataclass(frozen=True, slots=True)
class Capacity:
    """Resources of a machine, within the limits of this process."""

    cores: int
    free_bytes: int
    has_gpu: bool = False
    """A GPU may be present. Only a loaded model shows whether it is used."""

    @classmethod
    def of_this_machine(cls) -> Self:
        """Measure, with the limits that a container or a batch system has set for this process."""
        gpu = sys.platform == "darwin" or any(any(Path("/dev").glob(name)) for name in _GPU_DEVICES)
        return cls(granted_cores(), available_memory(), gpu)

    def initial_count(self, request: WorkerRequest, device: str | None) -> int:
        """Return the number of workers to start before one is measured; a model without `device` chooses its own."""
        if request.first_alone:
            return 1
        may_use_gpu = self.has_gpu and device != "cpu"
        fits = request.limit * AMPLE_BYTES <= self.free_bytes
        return request.limit if fits and not may_use_gpu else 1

    def summary(self, workers: int, measured: Prepared) -> str:
        """Return the number of workers and what it was chosen from."""
        cores = counted(self.cores, "core")
        if measured.description.sessions is not None:
            cores += f", {measured.description.sessions} sessions of the model's server"
        text = (
            f"{counted(workers, 'worker')}: {cores}, {self.free_bytes / GIB:.1f} GiB free; "
            f"one takes about {worker_bytes(measured) / GIB:.1f} GiB"
        )
        if gpu := measured.gpu:
            return f"{text} and {gpu.taken_bytes / GIB:.1f} of the GPU's {gpu.total_bytes / GIB:.1f} GiB"
        unknown = measured.description.on_gpu and measured.description.sessions is None
        return f"{text}; the model is on a GPU whose memory is not known" if unknown else text


def local_request(workers: int | None, trials: int, capacity: Capacity) -> WorkerRequest:
    """Return the workers to request on this machine; `workers` None chooses from cores and trials."""
    if workers is not None:
        return WorkerRequest(max(1, min(workers, trials)), is_explicit=True)
    return WorkerRequest(1 if trials < FEWEST_TRIALS else min(capacity.cores, trials), is_explicit=False)


def worker_bytes(measured: Prepared) -> int:
    """Return the memory of a worker that runs trials."""
    return measured.memory_bytes + RUNNING_BYTES


def choose_count(request: WorkerRequest, capacity: Capacity, measured: Prepared, started: int = 1) -> int:
    """Return the number of workers to run, once one has been measured.

    Args:
        request: number of workers requested.
        capacity: of this machine.
        measured: memory of one worker. A model on a GPU of unknown memory gets one worker, unless the user gave a
            number.
        started: number of workers that exist already, on the GPU too.

    Raises:
        UsageError: the requested number does not fit into memory, or exceeds the sessions of the model's server.
    """
    described = measured.description
    request = _within_sessions(request, described.sessions)
    one_bytes, gpu = worker_bytes(measured), measured.gpu
    fitting = max(1, capacity.free_bytes // one_bytes)
    fitting_on_gpu = fitting if gpu is None else started + gpu.free_bytes // gpu.taken_bytes
    if gpu is None and described.sessions is None and not request.is_explicit and described.on_gpu:
        return 1
    if request.limit <= min(fitting, fitting_on_gpu):
        return request.limit
    if not request.is_explicit:
        return min(fitting, fitting_on_gpu)
    where, takes, free = "", one_bytes, capacity.free_bytes
    if gpu is not None and fitting_on_gpu < fitting:
        where, takes, fitting = " of the GPU", gpu.taken_bytes, fitting_on_gpu
        free = started * gpu.taken_bytes + gpu.free_bytes
    raise UsageError(
        f"{request.limit} workers do not fit: one takes about {takes / GIB:.1f} GiB{where}, and {free / GIB:.1f} GiB "
        f"are free, enough for {fitting}",
        advice=f"give --workers {fitting}, or leave it out",
        code="too-many-workers",
    )


def _within_sessions(request: WorkerRequest, sessions: int | None) -> WorkerRequest:
    """Return a request for at most as many workers as the model's server has sessions.

    Raises:
        UsageError: the user requested more.
    """
    if sessions is None or request.limit <= sessions:
        return request
    if not request.is_explicit:
        return replace(request, limit=sessions)
    raise UsageError(
        f"{request.limit} workers need as many sessions, and the model's server has {sessions}",
        advice=f"give --workers {sessions}, or start the server with --sessions {request.limit}",
        code="too-few-sessions",
    )


def worker_request(
    options: WorkerOptions, spec: TrialSetupSpec, trials: int, *, live: bool, attended: bool = False
) -> WorkerRequest | None:
    """Return the workers to request on this machine; None for those of the cluster of the options.

    Args:
        options: options of the command line.
        spec: the workers' setup.
        trials: maximum number of trials.
        live: each episode is shown as it happens.
        attended: an operator is at the robot.

    Raises:
        UsageError: several workers were requested for a single robot, model or viewer.
    """
    single, is_served = "", is_address(spec.model)
    if not is_simulated(spec.robot):
        single = f"robot {spec.robot} is a single robot; only vsnbench's simulated robots can run in several workers"
    elif spec.rehearsal:
        single = "--rehearse has one robot, which the operator places"
    elif live:
        single = "--live shows one episode at a time"
    elif is_human(spec.model):
        single = "a person drives one robot at a time"
    elif attended:
        single = "--console has an operator at one robot"
    elif is_served and options.cluster:
        single = f"the cluster's nodes may not reach the model at {spec.model}"
    several = f"--workers {options.cluster or options.count}"
    if single and (options.cluster or (options.count or 1) > 1):
        raise UsageError(
            f"{several}: {single}", advice=f"leave {several.split(maxsplit=1)[0]} out", code="single-worker"
        )
    if options.cluster:
        return None
    if single:
        return WorkerRequest(1, is_explicit=False)
    request = local_request(options.count, trials, Capacity.of_this_machine())
    return replace(request, first_alone=is_served)
