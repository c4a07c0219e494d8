"""Trials as Ray's tasks: Ray schedules and retries them and moves their results; nothing here runs on a worker's disk.

`ray://host:port` is the address of a cluster's client server. Workers need vsnbench and the model installed, and
neither this machine's files nor its database.
"""

import importlib.util
import logging
import math
import re
import shlex
import socket
import sys
import threading
import uuid
import warnings
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import urlsplit

from vsnbench.database.campaign_plan import Trial
from vsnbench.database.provenance import Provenance
from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.harmless_text import error_line
from vsnbench.runner.bench import Bench, BenchDescription, BenchPlan, open_bench
from vsnbench.runner.pool.merging import TaskLost
from vsnbench.runner.pool.sealed import SealedEpisode, run_sealed
from vsnbench.runner.pool.shipping import ShippedPlan

logger = logging.getLogger(__name__)

KNOCK_TIMEOUT_S = 5.0
CONNECT_TIMEOUT_S = 60.0
FIRST_BENCH_TIMEOUT_S = 300.0
"""How long the first worker may take: its node may have to be started, and load a large checkpoint."""
_SERVER_FAILED = "Starting Ray client server failed"
"""Ray's own words, in the midst of a traceback."""
RETRIES = 3
"""How often Ray itself runs a task again whose node or process is gone."""


@dataclass(frozen=True, slots=True)
class ClusterAddress:
    """Where a cluster's client server listens."""

    host: str
    port: int

    @classmethod
    def parse(cls, text: str) -> "ClusterAddress":
        """Read `ray://host:port`.

        Raises:
            UsageError: it is none.
        """
        advice = "give it as ray://host:port; a head node's client server listens on port 10001"
        try:
            parts = urlsplit(text)
            host, port = parts.hostname, parts.port
        except ValueError as error:
            raise UsageError(f"--cluster {text}: {error}", advice=advice) from error
        if parts.scheme != "ray" or not host or parts.path.strip("/") or parts.query or parts.username is not None:
            raise UsageError(f"--cluster {text} is no address of a Ray cluster", advice=advice)
        return cls(host, port or 10001)

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"ray://{host}:{self.port}"


@dataclass(frozen=True, slots=True)
class _Parcel:
    """What comes with every task; a worker fetches the plan itself once."""

    key: str
    shipped: tuple[Any, ...]
    """Ray's reference to a ShippedPlan; in a tuple, so that Ray leaves it one."""
    command: str


class RayTasks:
    """Runs trials on a Ray cluster."""

    def __init__(self, plan: BenchPlan, address: ClusterAddress, workers: int | None, gpus_each: float = 0.0) -> None:
        """Connect, and have one worker make the bench.

        Args:
            plan: what every worker makes its bench from.
            address: of the cluster.
            workers: how many trials at once at most; as many as it has cores when None.
            gpus_each: how much of a GPU each holds.

        Raises:
            UsageError: Ray is not installed, or the plan does not fit together.
            VsnbenchError: nobody answers in time, or with another version.
        """
        plan = with_device_held(plan, gpus_each)
        shipped = ShippedPlan.of(plan)
        self._ray = _connected(address)
        self._trials: dict[Any, Trial] = {}
        try:
            options = {"num_cpus": 1, "num_gpus": gpus_each, "max_retries": RETRIES, "max_calls": 0}
            self._run = self._ray.remote(**options)(run_task)
            self._parcel = _Parcel(str(uuid.uuid4()), (self._ray.put(shipped),), shlex.join(sys.argv))
            self.description = self._first_bench(options)
            alike = ShippedPlan.of(plan.for_elsewhere(self.description.card))
            self._parcel = replace(self._parcel, shipped=(self._ray.put(alike),))
            self._at_once = self._places(gpus_each) if workers is None else workers
        except BaseException:
            self.cancel()
            raise
        self.words = f"{self._at_once} workers on {address}, Ray {self._ray.__version__}"

    @property
    def room(self) -> int:
        """What runs, and an eighth more that waits, so that no worker waits for the driver."""
        return self._at_once + max(1, self._at_once // 8)

    def submit(self, trial: Trial, seed: int) -> None:
        """Have a trial run."""
        self._trials[self._run.remote(self._parcel, trial, seed)] = trial

    def results(self, timeout_s: float) -> Sequence[SealedEpisode | TaskLost]:
        """Return what has come back.

        Raises:
            VsnbenchError: no worker can make the bench, or the cluster is gone.
        """
        back: list[SealedEpisode | TaskLost] = []
        try:
            ready, _ = self._ray.wait(list(self._trials), num_returns=1, timeout=timeout_s)
        except Exception as error:
            raise VsnbenchError(
                f"the cluster is gone: {error_line(error)}", advice="the same command goes on with the trials left"
            ) from error
        for done in ready:
            trial = self._trials.pop(done)
            try:
                answer = self._ray.get(done)
            except Exception as error:  # the task's node or process is gone, Ray's own tries included
                back.append(TaskLost(trial, error_line(error)))
                continue
            if isinstance(answer, VsnbenchError):
                raise answer
            back.append(answer)
        return back

    def cancel(self) -> None:
        """Have nothing run any more, and let the cluster go."""
        for task in self._trials:
            try:
                self._ray.cancel(task, force=True)
            except Exception as error:  # the cluster is gone, and the task with it
                logger.debug("a task was not cancelled: %s", error_line(error))
        self._trials.clear()
        self._ray.shutdown()

    def _first_bench(self, options: dict[str, Any]) -> BenchDescription:
        asked = self._ray.remote(**options)(describe_task).remote(self._parcel)
        ready, _ = self._ray.wait([asked], timeout=FIRST_BENCH_TIMEOUT_S)
        if not ready:
            wants = f"a core and {options['num_gpus']:g} GPUs" if options["num_gpus"] else "a core"
            raise VsnbenchError(
                f"no worker of the cluster was ready within {FIRST_BENCH_TIMEOUT_S:.0f} s: each wants {wants}",
                advice="see with `ray status` what the cluster has",
            )
        try:
            answer = self._ray.get(asked)
        except Exception as error:
            raise VsnbenchError(
                f"a worker of the cluster cannot run vsnbench: {error_line(error)}",
                advice="install the same vsnbench on every node",
            ) from error
        if isinstance(answer, VsnbenchError):
            raise answer
        described: BenchDescription = answer
        return described

    def _places(self, gpus_each: float) -> int:
        has = self._ray.cluster_resources()
        places = float(has.get("CPU", 1))
        if gpus_each:
            places = min(places, float(has.get("GPU", 0)) / gpus_each)
        return max(1, math.floor(places))


def with_device_held(plan: BenchPlan, gpus_each: float) -> BenchPlan:
    """Return the plan with the model on what each worker holds, on whichever node it is: a part of a GPU, or a core.

    Raises:
        UsageError: the device that was asked for is another.
    """
    asked = plan.model_options.get("device") or "auto"
    if asked not in ("auto", "cpu") and not gpus_each:
        raise UsageError(
            f"--device {asked}: workers of a cluster hold no GPU unless they say so, and Ray cannot tell where one is",
            advice="give --gpus 1, or --gpus 0.25 for four workers on one",
        )
    if asked == "cpu" and gpus_each:
        raise UsageError(f"--gpus {gpus_each:g}: the model is to run on the CPU", advice="leave out --gpus or --device")
    if asked != "auto" or not plan.model_takes("device"):
        return plan
    return replace(plan, model_options={**plan.model_options, "device": "cuda" if gpus_each else "cpu"})


def _connected(address: ClusterAddress) -> Any:
    """Return the module `ray`, connected, in bounded time and without its own words on the console."""
    if importlib.util.find_spec("ray") is None:
        raise UsageError("Ray is not installed", advice="pip install 'vsnbench[ray]'")
    try:
        socket.create_connection((address.host, address.port), KNOCK_TIMEOUT_S).close()
    except OSError as error:
        raise VsnbenchError(
            f"--cluster {address}: nobody answers ({error.strerror or error})",
            advice="is the head node up, started with `ray start --head --ray-client-server-port 10001`?",
        ) from error
    import ray

    warnings.filterwarnings("ignore", module="ray")  # what it warns of, it raises too
    failed: list[BaseException] = []

    def connect() -> None:
        try:
            ray.init(str(address), log_to_driver=False, logging_level=logging.ERROR)
        except BaseException as error:  # whatever Ray raises is one line for the user
            failed.append(error)

    thread = threading.Thread(target=connect, name="ray", daemon=True)
    thread.start()
    thread.join(CONNECT_TIMEOUT_S)
    if thread.is_alive():
        raise VsnbenchError(
            f"--cluster {address}: who answers there is no Ray client server, or does not answer in "
            f"{CONNECT_TIMEOUT_S:.0f} s",
            advice="see with `ray status` on the head node",
        )
    if failed:
        raise _refusal(address, failed[0])
    return ray


def _refusal(address: ClusterAddress, error: BaseException) -> VsnbenchError:
    """Return what kept Ray from connecting, with what to do about it."""
    words = error_line(error, named=False)
    if isinstance(error, ConnectionError) and _SERVER_FAILED in words:
        return VsnbenchError(
            f"--cluster {address}: the head node could not start a client server in time",
            advice="try again; start the head with GRPC_ENABLE_FORK_SUPPORT=0, as docs/scale.md does",
        )
    if isinstance(error, ConnectionError):  # a wrong token reads like silence
        return VsnbenchError(
            f"--cluster {address}: it does not answer, or does not know this $RAY_AUTH_TOKEN ({words})",
            advice="see docs/scale.md for the token",
        )
    if "version" in words.lower():
        there = re.search(r"started with:\s*Ray: ([\w.]+)", words)
        return VsnbenchError(
            f"--cluster {address}: another version of Ray or Python is there: {words}",
            advice=f"install the cluster's here: pip install 'ray[client]=={there[1] if there else '...'}'",
        )
    return VsnbenchError(f"--cluster {address}: {words}", advice="see docs/scale.md")


@dataclass(frozen=True, slots=True)
class _Resident:
    """The bench of a worker's process, kept from task to task."""

    key: str
    plan: BenchPlan
    bench: Bench
    ran_on: Provenance
    stack: ExitStack


_resident: _Resident | None = None


def _bench_of(parcel: "_Parcel") -> _Resident:
    global _resident
    if _resident is not None and _resident.key == parcel.key:
        return _resident
    if _resident is not None:
        _resident.stack.close()
        _resident = None
    import ray

    shipped: ShippedPlan = ray.get(parcel.shipped[0])
    plan, stack = shipped.unpacked(), ExitStack()
    bench = stack.enter_context(open_bench(plan))
    _resident = _Resident(parcel.key, plan, bench, bench.provenance(parcel.command), stack)
    return _resident


def describe_task(parcel: "_Parcel") -> BenchDescription | VsnbenchError:
    """Make the bench on a worker and say what it is; an error for the user comes back as a value."""
    try:
        return _bench_of(parcel).bench.description
    except VsnbenchError as error:
        return error


def run_task(parcel: "_Parcel", trial: Trial, seed: int) -> SealedEpisode | VsnbenchError:
    """Run one trial on a worker; an error for the user comes back as a value."""
    try:
        resident = _bench_of(parcel)
        return run_sealed(resident.bench, resident.ran_on, resident.plan, trial, seed)
    except VsnbenchError as error:
        return error
