"""What runs the trials of a campaign: this process with its own robot, local workers or a Ray cluster."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial

from vsnbench.results.writing.campaigns import OpenCampaign
from vsnbench.results.writing.provenance import Provenance, gather_provenance
from vsnbench.robots.contract import BatteryReader, CameraPreview
from vsnbench.runner.executors.capacity import ClusterRequest, WorkerRequest
from vsnbench.runner.executors.collecting import MergingPool
from vsnbench.runner.executors.contract import TrialPool
from vsnbench.runner.executors.in_process import DrivingModel, InProcessExecutor, SingleModel
from vsnbench.runner.executors.local_pool import SharedWorkers
from vsnbench.runner.executors.pool import PoolExecutor
from vsnbench.runner.executors.process import dismiss_fork_server
from vsnbench.runner.executors.ray_pool import RayTasks
from vsnbench.runner.loop.contract import TrialExecutor
from vsnbench.runner.loop.session_context import SessionContext
from vsnbench.runner.setup.trial_setup import SetupDescription, TrialSetup, TrialSetupSpec, open_trial_setup


@dataclass(frozen=True, slots=True)
class Backend:
    """A robot and a model that are ready, in this process or in workers."""

    description: SetupDescription
    """Robot and model of every trial of the campaign."""
    halt: Callable[[], None]
    """Halts every robot, from any thread, before the process is forced to end."""
    executor: Callable[[SessionContext, OpenCampaign], TrialExecutor]
    """Returns what runs the trials of a session."""
    provenance: Callable[[], Provenance]
    """Describes this process as far as results depend on it."""
    glimpse: CameraPreview | None = None
    """Camera image while the robot drives; None for several robots, and for a robot without it."""
    battery: BatteryReader = lambda: None
    """Reads the battery of the robot's base."""


@contextmanager
def open_backend(
    spec: TrialSetupSpec, request: WorkerRequest | ClusterRequest, shared: SharedWorkers | None = None
) -> Iterator[Backend]:
    """Make the setup in this process, start workers, or connect to a cluster.

    `shared` are workers of this machine that outlive the campaign. Without them, workers end with the context.

    Raises:
        UsageError: something named does not exist, does not fit together, or does not fit into memory.
        VsnbenchError: the model, the robot or the cluster cannot be used.
    """
    if isinstance(request, ClusterRequest):
        with MergingPool(RayTasks(spec, request)) as pool:
            yield _of_workers(pool)
    elif request.limit == 1:
        dismiss_fork_server()
        with open_trial_setup(spec) as setup:
            yield _in_process(setup)
    else:
        own = SharedWorkers() if shared is None else nullcontext(shared)
        with own as workers, workers.prepared(spec, request) as local:
            yield _of_workers(local)


def _in_process(setup: TrialSetup) -> Backend:
    description, robot = setup.description, setup.robot
    model = SingleModel(DrivingModel(setup.policy, description.title))
    return Backend(
        description,
        robot.halt,
        lambda context, _campaign: InProcessExecutor(context, robot, model),
        setup.provenance,
        robot.preview if robot.has_preview else None,
        lambda: robot.battery,
    )


def _of_workers(pool: TrialPool) -> Backend:
    return Backend(
        pool.description, pool.kill, partial(PoolExecutor, pool=pool), partial(gather_provenance, of_run=True)
    )
