"""Runs trials as Ray tasks: Ray schedules and retries them and transfers their results.

`ray://host:port` is the address of a cluster's client server. Workers need vsnbench and the model, but no
access to this machine's files or database.
"""

import logging
import math
import shlex
import sys
import uuid
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.provenance import Provenance
from vsnbench.runner.executors.capacity import WorkerOptions
from vsnbench.runner.executors.collecting import TaskRunner
from vsnbench.runner.executors.episode_bundle import EpisodeBundle, run_bundled
from vsnbench.runner.executors.plan_transfer import PackedSpec
from vsnbench.runner.executors.ray_connection import ClusterAddress, connect
from vsnbench.runner.loop.contract import TrialReturned
from vsnbench.runner.setup.trial_setup import SetupDescription, TrialSetup, TrialSetupSpec, open_trial_setup
from vsnbench.text.sanitize import counted, error_line

logger = logging.getLogger(__name__)

FIRST_SETUP_TIMEOUT_S = 300.0
"""Time for the first worker, whose node may have to start and load a large checkpoint."""
RETRIES = 3
"""Number of times that Ray repeats a task whose node or process was lost."""


@dataclass(frozen=True, slots=True)
class _Parcel:
    """Arguments of every task. A worker fetches the spec once."""

    key: str
    packed: tuple[Any, ...]
    """Ray's reference to a PackedSpec, in a tuple so that Ray does not resolve it."""
    command: str


class RayTasks(TaskRunner):
    """Runs trials on a Ray cluster."""

    def __init__(self, spec: TrialSetupSpec, options: WorkerOptions) -> None:
        """Connect to the cluster of the options, and have one worker make the trial setup.

        Raises:
            UsageError: Ray is not installed, or the spec is not consistent.
            VsnbenchError: the cluster does not answer in time, or runs another version.
        """
        address, workers, gpus_each = options.cluster, options.count, options.gpus_each
        if address is None:
            raise ValueError("the options name no cluster")
        spec = with_worker_device(spec, gpus_each)
        packed = PackedSpec.of(spec)
        self._ray = connect(address)
        self._trials: dict[Any, Trial] = {}
        try:
            needs = {"num_cpus": 1, "num_gpus": gpus_each, "max_retries": RETRIES, "max_calls": 0}
            self._run = self._ray.remote(**needs)(run_task)
            self._parcel = _Parcel(str(uuid.uuid4()), (self._ray.put(packed),), shlex.join(sys.argv))
            places = self._capacity_now(address, gpus_each)
            self.description = self._first_setup(needs)
            chosen = PackedSpec.of(spec.for_elsewhere(self.description.card))
            self._parcel = replace(self._parcel, packed=(self._ray.put(chosen),))
            self._at_once = workers or places
        except BaseException:
            self.cancel()
            raise
        self.summary = _workers_text(places, workers, address, self._ray.__version__)

    @property
    def capacity(self) -> int:
        """Number of running tasks, and an eighth more so that no worker waits for the driver."""
        return self._at_once + max(1, self._at_once // 8)

    def submit(self, trial: Trial, seed: int) -> None:
        """Have a trial run."""
        self._trials[self._run.remote(self._parcel, trial, seed)] = trial

    def results(self, timeout_s: float) -> Sequence[EpisodeBundle | TrialReturned]:
        """Return finished tasks."""
        finished: list[EpisodeBundle | TrialReturned] = []
        try:
            ready, _ = self._ray.wait(list(self._trials), num_returns=1, timeout=timeout_s)
        except Exception as error:
            raise VsnbenchError(
                f"lost the cluster: {error_line(error)}",
                advice="repeat the command to run the remaining trials",
                code="cluster-lost",
            ) from error
        for done in ready:
            trial = self._trials.pop(done)
            try:
                answer = self._ray.get(done)
            except Exception as error:  # the task's node or process was lost, after Ray's retries
                finished.append(TrialReturned(trial, error_line(error)))
                continue
            if isinstance(answer, VsnbenchError):
                raise answer
            finished.append(answer)
        return finished

    def cancel(self) -> None:
        """Cancel all tasks and disconnect."""
        for task in self._trials:
            try:
                self._ray.cancel(task, force=True)
            except Exception as error:  # the cluster is lost, and the task with it
                logger.debug("a task was not cancelled: %s", error_line(error))
        self._trials.clear()
        self._ray.shutdown()

    def _first_setup(self, options: dict[str, Any]) -> SetupDescription:
        task = self._ray.remote(**options)(describe_task).remote(self._parcel)
        ready, _ = self._ray.wait([task], timeout=FIRST_SETUP_TIMEOUT_S)
        if not ready:
            needs = f"a core and {options['num_gpus']:g} GPUs" if options["num_gpus"] else "a core"
            raise VsnbenchError(
                f"no worker of the cluster was ready within {FIRST_SETUP_TIMEOUT_S:.0f} s: each needs {needs}",
                advice="`ray status` shows the resources of the cluster",
                code="no-worker",
            )
        try:
            answer = self._ray.get(task)
        except Exception as error:
            raise VsnbenchError(
                f"a worker of the cluster cannot run vsnbench: {error_line(error)}",
                advice="install the same vsnbench on every node",
            ) from error
        if isinstance(answer, VsnbenchError):
            raise answer
        description: SetupDescription = answer
        return description

    def _capacity_now(self, address: ClusterAddress, gpus_each: float) -> int:
        """Return the number of workers that the cluster's nodes hold now.

        Raises:
            UsageError: the cluster is too small for one.
        """
        has = self._ray.cluster_resources()
        places = float(has.get("CPU", 0))
        if gpus_each:
            places = min(places, float(has.get("GPU", 0)) / gpus_each)
        if places < 1:
            gpus = f"{gpus_each:g} GPU{'' if gpus_each == 1 else 's'}"
            wanted = f"a core and {gpus}" if gpus_each else "a core"
            raise UsageError(
                f"--workers {address}: the cluster has {has.get('CPU', 0):g} cores and {has.get('GPU', 0):g} GPUs, and "
                f"each worker needs {wanted}",
                advice="lower gpus_per_worker in section [cluster] of vsnbench.toml, or start a node with GPUs"
                if gpus_each
                else "start a node",
            )
        return math.floor(places)


def _workers_text(places: int, requested: int | None, address: ClusterAddress, version: str) -> str:
    count = min(places, requested or places)
    more = (
        f" ({requested} requested; more start when the cluster has capacity)"
        if requested and requested > places
        else ""
    )
    return f"{counted(count, 'worker')} on {address}, Ray {version}{more}"


def with_worker_device(spec: TrialSetupSpec, gpus_each: float) -> TrialSetupSpec:
    """Return the spec with the model on the device that each worker holds: a share of a GPU, or a core.

    Raises:
        UsageError: another device was requested.
    """
    device = spec.options.get("device") or "auto"
    if device not in ("auto", "cpu") and not gpus_each:
        raise UsageError(
            f"device {device}: workers of a cluster hold no GPU by default",
            advice="set gpus_per_worker in section [cluster] of vsnbench.toml: 1, or 0.25 for four workers on one GPU",
            code="no-gpu-requested",
        )
    if device == "cpu" and gpus_each:
        raise UsageError(f"gpus_per_worker = {gpus_each:g} conflicts with device cpu", advice="remove one of them")
    if device != "auto" or not spec.model_takes("device"):
        return spec
    return replace(spec, model_options={**spec.options, "device": "cuda" if gpus_each else "cpu"})


@dataclass(frozen=True, slots=True)
class _Resident:
    """Trial setup of a worker process, which its tasks share."""

    key: str
    spec: TrialSetupSpec
    setup: TrialSetup
    ran_on: Provenance
    stack: ExitStack


_resident: _Resident | None = None


def _setup_of(parcel: "_Parcel") -> _Resident:
    global _resident
    if _resident is not None and _resident.key == parcel.key:
        return _resident
    if _resident is not None:
        _resident.stack.close()
        _resident = None
    import ray

    packed: PackedSpec = ray.get(parcel.packed[0])
    spec, stack = packed.unpacked(), ExitStack()
    setup = stack.enter_context(open_trial_setup(spec))
    _resident = _Resident(parcel.key, spec, setup, setup.provenance(parcel.command), stack)
    return _resident


def describe_task(parcel: "_Parcel") -> SetupDescription | VsnbenchError:
    """Make the trial setup on a worker and describe it. Errors for the user are returned as values."""
    try:
        return _setup_of(parcel).setup.description
    except VsnbenchError as error:
        return error


def run_task(parcel: "_Parcel", trial: Trial, seed: int) -> EpisodeBundle | VsnbenchError:
    """Run one trial on a worker. Errors for the user are returned as values."""
    try:
        resident = _setup_of(parcel)
        return run_bundled(resident.setup, resident.ran_on, resident.spec, trial, seed)
    except VsnbenchError as error:
        return error
